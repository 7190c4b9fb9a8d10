"""What a result says in numbers, tables and figures is what its rows say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import stats

from gapsense.many import store as of
from gapsense.many import summary
from gapsense.many.columns import Columns, contents
from gapsense.many.result import FORMAT, KEY, read_campaign
from gapsense.many.store import Store
from gapsense.many.summary import extremes
from gapsense.problems import InputError
from gapsense.report import campaigns
from gapsense.report.table import text

FACTORS = {"a.x": ("double", "V"), "a.steps": ("int64", ""), "a.mode": ("string", ""), "a.flag": ("bool", "")}
COLUMNS = Columns(FACTORS, {"up": "A", "noise": "A", "none": ""}, texts={"a.mode": ["up", "down"]})
ABOUT = {"title": "Draws", "scenario": "demo", "labels": {n: ["", n] for n in COLUMNS.metrics}}


def stored(folder, entries, runs):
    """A result of some runs."""
    with Store(folder / "campaign.sqlite", KEY) as store:
        store.describe({**ABOUT, "runs": runs, "format": FORMAT, "columns": COLUMNS.facts()})
        store.add(*contents(COLUMNS, entries))
    return read_campaign(folder)


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Maker of a result of so many runs, one in 50 failed, and its values."""
    monkeypatch.setattr(of, "GROUP", 900)
    monkeypatch.setattr("gapsense.many.result.SOME", 700)

    def make(count: int):
        random = np.random.default_rng(2)
        x, noise = random.normal(5.0, 2.0, count), random.normal(size=count)
        lines = []
        for k in range(count):
            values = {"a.x": x[k], "a.steps": k % 3, "a.mode": "up" if k % 2 else "down", "a.flag": k % 4 == 0}
            metrics = {"up": x[k] ** 3, "noise": noise[k], "none": None}
            end = {"error": "stuck"} if k % 50 == 7 else {"metrics": metrics, "wall": 0.1}
            lines.append({"index": k, "shift": k, "values": values, **end})
        good = np.arange(count) % 50 != 7
        return stored(tmp_path / "out", lines, count), x, np.where(good, x**3, np.nan)

    return make


def test_quantiles_are_those_of_all_rows(made):
    result, x, up = made(2600)
    good = up[np.isfinite(up)]
    assert result.quantiles()["up"] == tuple(np.quantile(good, (0.05, 0.5, 0.95)))
    assert result.column("a.x").tolist() == x.tolist()
    found = summary.spread(result, "up")
    assert (found.least, found.greatest, found.missing) == (good.min(), good.max(), 52)
    assert np.isnan(summary.spread(result, "none").median) and summary.spread(result, "none").missing == 2600


def test_leading_parameter_is_found_by_rank_correlation(made):
    result, x, _ = made(2600)
    found = summary.leading(result)
    assert found["up"].factor == "a.x" and found["up"].correlation == pytest.approx(1.0)
    assert abs(found["noise"].correlation) < 0.1 and "none" not in found
    y = np.random.default_rng(5).normal(size=x.size) + x
    assert summary.correlation(summary.ranks(x), summary.ranks(y)) == pytest.approx(
        stats.spearmanr(x, y).statistic, abs=1e-12
    )
    assert summary.correlation(x, np.ones_like(x)) == 0.0


def test_share_of_what_goes_up_and_down_is_large_where_the_correlation_is_none():
    random = np.random.default_rng(6)
    x, noise = random.normal(size=4000), random.normal(size=4000)
    ranked = {name: summary.ranks(values) for name, values in {"x": x, "v": np.abs(x), "noise": noise}.items()}
    assert abs(summary.correlation(ranked["x"], ranked["v"])) < 0.1 and summary.share(ranked["x"], ranked["v"]) > 0.95
    assert summary.share(ranked["x"], ranked["noise"]) < 0.02 and summary.share(ranked["x"], ranked["x"]) > 0.99
    assert summary.share(ranked["x"], np.ones(4000)) == summary.share(np.ones(4000), ranked["x"]) == 0.0
    steps = summary.ranks(np.arange(4000.0) % 3)  # ties: a layer has no run
    assert summary.share(steps, steps) == pytest.approx(1.0)


def test_correlations_of_many_runs_are_those_of_a_part(made, monkeypatch):
    monkeypatch.setattr(summary, "SAMPLED", 300)
    result, _, _ = made(2600)
    sample = summary.sample_columns(result, ["a.x", "up"])
    assert 200 < sample["a.x"].size < 400
    good = np.isfinite(sample["up"])
    assert sample["up"][good] == pytest.approx(sample["a.x"][good] ** 3, rel=1e-12)
    assert np.array_equal(summary.sample_columns(result, ["a.x"])["a.x"], sample["a.x"])


def test_groups_and_clouds_count_every_run(made):
    result, x, up = made(2600)
    assert summary.levels(result, "a.mode") == ["down", "up"]
    assert (summary.levels(result, "a.steps"), summary.levels(result, "a.flag")) == ([0, 1, 2], [False, True])
    assert summary.levels(result, "a.x") is None
    own = up[np.arange(2600) % 3 == 1]
    expected = tuple(np.quantile(own[np.isfinite(own)], (0.05, 0.5, 0.95)))
    assert summary.group_metric(result, "a.steps", "up", [0, 1, 2])[1] == expected
    cloud = summary.clouds(result, ["a.x"], ["up"])["a.x", "up"]
    inside = np.isfinite(up) & (x >= cloud.x[0]) & (x <= cloud.x[-1]) & (up >= cloud.y[0]) & (up <= cloud.y[-1])
    assert cloud.counts.sum() == inside.sum() > 2500
    good = np.isfinite(up)
    assert np.array_equal(cloud.counts, np.histogram2d(x[good], up[good], (cloud.x, cloud.y))[0])
    assert summary.places(np.array([0.0, 0.5, 1.0, 2.0, 2.1, -0.1, np.nan]), np.array([0.0, 1.0, 2.0])).tolist() == [
        *(0, 0, 1, 1, -1, -1, -1)
    ]
    bins, counts = summary.histogram(result, "up")
    assert counts.sum() == ((up >= bins[0]) & (up <= bins[-1])).sum()


def test_tables_say_what_there_is_and_what_failed(made):
    result, _, _ = made(300)
    shown = text(*campaigns.summary(result))
    assert "Draws: demo, 300 of 300 runs, 6 failed" in shown
    assert "run 7: stuck" in shown and "1 more failed: column `error`." in shown
    assert "a.x +1.00" in shown and "down, up" in shown and "False, True" in shown


def test_result_without_runs_or_metrics_is_shown_and_not_drawn(tmp_path):
    result = stored(tmp_path, [], 9)
    assert text(*campaigns.summary(result)) == "Draws: demo, 0 of 9 runs, 0 failed"
    with pytest.raises(InputError, match="no metrics to draw yet"):
        campaigns.figure(result)


@pytest.mark.parametrize(("count", "many"), [(300, False), (2600, True)])
def test_figure_has_a_panel_for_each_metric_and_parameter(made, count, many):
    result, _, _ = made(count)
    figure = campaigns.figure(result)
    assert len(figure.axes) == 3 * 5
    over_x, over_steps = figure.axes[1], figure.axes[2]
    assert bool(over_x.collections) is many and bool(over_x.lines) is not many
    assert [label.get_text() for label in over_steps.get_xticklabels()] == ["0", "1", "2"]
    assert figure.axes[-4].get_xlabel() == "a.x\n/ V" and figure.axes[0].get_ylabel() == "up\n/ A"
    figure.canvas.draw()
    assert len(campaigns.figure(result, ["noise"], ["a.flag"]).axes) == 2
    with pytest.raises(InputError, match=r"no metric `nois`\. Did you mean `noise`"):
        campaigns.figure(result, ["nois"])
    with pytest.raises(InputError, match=r"no parameter `a.y`"):
        campaigns.figure(result, [], ["a.y"])


@pytest.mark.parametrize(("count", "most_left_out"), [(200, 0), (2600, 8)])
def test_histogram_has_all_runs_but_of_many_a_few_at_both_ends(made, count, most_left_out):
    result, _, up = made(count)
    edges, counts = summary.histogram(result, "up")
    left_out = np.isfinite(up).sum() - counts.sum()
    assert 0 <= left_out <= most_left_out and (left_out > 0) == (most_left_out > 0)
    assert counts.size == edges.size - 1


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [((0.0, 10.0), [3, 2]), ((-1.0, 10.0), [0, 3]), ((0.0, 3.5), [3, 2]), ((0.0, np.inf), [0, 1])],
)
def test_what_has_no_sign_is_no_worse_for_being_small(tmp_path, bounds, expected):
    values = {"a.x": 1.0, "a.steps": 1, "a.mode": "up", "a.flag": True}
    metrics = [{"up": up, "noise": 0.0, "none": None} for up in (0.5, 3.0, 4.0, 7.0)]
    lines = [{"index": k, "shift": k, "values": values, "metrics": m, "wall": 0.1} for k, m in enumerate(metrics)]
    result = stored(tmp_path / "out", lines, 4)
    found = extremes(result, summary.spread(result, "up"), bounds, 2)
    assert [one.run for one in found.worst] == expected


@pytest.mark.parametrize("value", [0.0, 2e-6, 76.0, 1e17])
def test_bins_of_values_that_differ_by_rounding_have_the_size_of_the_values(value):
    values = value * np.array([1.0, 1.0 + 3e-16, 1.0])
    edges = summary.edges(values)
    assert edges[-1] - edges[0] == pytest.approx(value or 1.0) and (np.diff(edges) > 0.0).all()


@pytest.mark.parametrize(
    ("unit", "values", "label", "number"),
    [("m", [0.0, 2e-5], "a\n/ um", "20"), ("1", [0.0, 0.02], "a", None), ("", ["up", "down"], "a", None)],
)
def test_axis_has_the_prefix_that_suits_a_unit_and_none_without_one(unit, values, label, number):
    axis = Figure().subplots().yaxis
    before = axis.get_major_formatter()
    campaigns.scale(axis, SimpleNamespace(units={"a": unit}, column=lambda _: np.array(values)), "a")
    assert axis.get_label_text() == label
    assert axis.get_major_formatter() is before if number is None else axis.get_major_formatter()(2e-5) == number
