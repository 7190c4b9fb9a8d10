"""What a report shows, before it is drawn."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from html_results import made
from hypothesis import given
from hypothesis import strategies as st

from gapsense.cosim import load, read_result, run
from gapsense.cosim.result.metrics import rms
from gapsense.cosim.result.result import Signal
from gapsense.cosim.scenario.records import Metric, Port, Span
from gapsense.report.html import curves
from gapsense.report.html.figures import make_time_axis
from gapsense.report.html.run import consistency, pairs, panels, strips
from gapsense.report.html.subject import Shown, read_all, regression
from gapsense.report.html.wiring import Wire, arrange_boxes

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def shown(result, scenario=None) -> Shown:
    return Shown(Path("x.csv"), result, scenario, "")


@given(st.lists(st.one_of(st.floats(-1e6, 1e6), st.just(float("nan"))), min_size=1, max_size=400), st.integers(4, 60))
def test_thinned_curve_has_its_ends_its_extremes_and_few_points(values, most):
    values = np.array(values)
    rows = curves.choose_rows(values, most)
    assert rows.size <= max(most, 2) and (np.diff(rows) > 0).all()
    assert rows[0] == 0 and rows[-1] == values.size - 1
    if np.isfinite(values).any():
        assert np.nanmax(values[rows]) == np.nanmax(values) and np.nanmin(values[rows]) == np.nanmin(values)


def test_every_piece_of_a_thinned_curve_has_its_extremes():
    values = np.random.default_rng(1).normal(size=100_000)
    rows = curves.choose_rows(values, 2002)
    for k in range(0, 100_000, 100):
        own = rows[(rows >= k) & (rows < k + 100)]
        assert values[own].max() == values[k : k + 100].max() and values[own].min() == values[k : k + 100].min()


def test_curves_of_large_reports_have_fewer_points():
    assert curves.most(10) == curves.MOST
    assert curves.most(400) * 400 <= curves.ALL


def test_estimate_is_held_to_the_plant_that_drives_it_and_never_the_other_way():
    result = made()
    assert [(p.signal, p.reference) for p in pairs(shown(result))] == [("filter.position", "plant.position")]
    apart = replace(result, run=replace(result.run, wires=("plant.current -> drive.x",)))
    assert pairs(shown(apart)) == []
    unknown = replace(result, run=replace(result.run, wires=()))  # a result of an older version
    assert len(pairs(shown(unknown))) == 1


def test_equal_names_with_other_units_are_not_compared():
    result = made()
    about = {**result.about, "plant.position": Signal("V", 1.0, "output")}
    assert pairs(shown(replace(result, about=about))) == []


def test_band_is_two_deviations_and_variances_are_roots():
    result = made()
    assert curves.from_signal(result, "filter.position").band == pytest.approx(4e-5)
    signals = {**result.signals, "plant.current_variance": np.full(result.times.size, 9.0)}
    assert curves.from_signal(replace(result, signals=signals), "plant.current").band == pytest.approx(6.0)
    assert curves.from_signal(result, "plant.position").band is None


def test_panels_have_truth_estimate_band_error_innovation_and_modes():
    found = {p.title: p for p in panels(shown(made()))}
    assert list(found) == ["position", "error of the position", "current", "innovation"]
    assert [(c.name, c.is_truth) for c in found["position"].curves] == [
        ("plant.position", True),
        ("filter.position", False),
    ]
    error = found["error of the position"].curves[0]
    assert error.values == pytest.approx(1e-5) and error.band == pytest.approx(4e-5)
    assert error.times[0] > 0.0  # the initial value is no estimate
    innovation = found["innovation"].curves[0]
    assert innovation.band == pytest.approx(2e-3) and innovation.times[0] > 0.0
    (mode,) = strips(shown(made()))
    assert mode.name == "plant.mode" and mode.values.tolist() == [0.0, 1.0, 2.0] and mode.end == made().times[-1]


def test_what_is_published_later_stands_at_its_times_and_nothing_before_the_record():
    """`Mhe` publishes samples before its first one, whose mean velocity is one from nowhere: 70 m/s."""
    times = 1e-4 * np.arange(6)
    later = {"filter.smoothed_time": times - 2e-4, "filter.smoothed_published": (times > 0.5e-4) * 1.0}
    values = {"plant.position": times, "filter.smoothed_position": times - 2e-4}
    velocity = {"filter.smoothed_velocity": np.array([0.0, 70.0, 1.0, 1.0, 1.0, 1.0])}
    result = made(6, {**values, **velocity, **later})
    units = {"filter.smoothed_velocity": "m/s", "filter.smoothed_position": "m", "filter.smoothed_time": "s"}
    about = {n: Signal(units[n], 1e-3, "output") if n in units else one for n, one in result.about.items()}
    about["filter.smoothed_published"] = Signal("1", 1.0, "output")
    ends = {"where": "filter.smoothed_published", "time": "filter.smoothed_time"}
    metric = Metric("held", "rmse", "filter.smoothed_position", "plant.position", **ends)
    found = {p.title: p for p in panels(shown(replace(result, about=about), SimpleNamespace(metrics=[metric])))}
    (curve,) = found["smoothed velocity"].curves
    assert curve.times == pytest.approx(times[:4]) and curve.values.max() == 1.0
    assert found["error of the position"].curves[0].times[0] == 0.0


def test_consistency_of_normal_errors_is_what_their_deviation_promises():
    """Against the normal distribution, for white and for correlated noise, and for a deviation that is too small."""
    noise = np.random.default_rng(7).normal(size=20_001)
    times, band = np.arange(20_000.0), np.full(20_000, 2.0 * 0.5)
    right = consistency(curves.Curve("f.innovation", times, 0.5 * noise[1:], band))
    assert right.inside == pytest.approx(0.9545, abs=0.005) and right.square == pytest.approx(1.0, abs=0.05)
    assert abs(right.correlation) < 2.0 * right.limit and right.samples == 20_000
    coloured = consistency(curves.Curve("f.innovation", times, 0.25 * (noise[1:] + noise[:-1]), band))
    assert coloured.correlation == pytest.approx(0.5, abs=0.02) and coloured.square == pytest.approx(0.5, abs=0.03)
    bold = consistency(curves.Curve("f.innovation", times, 1.0 * noise[1:], band))
    assert bold.inside == pytest.approx(0.6827, abs=0.01) and bold.square == pytest.approx(4.0, abs=0.2)


def test_consistency_leaves_out_what_is_known_exactly_and_what_says_nothing():
    times, ones = np.arange(100.0), np.ones(100)
    assert consistency(curves.Curve("x", times, ones)) is None
    assert consistency(curves.Curve("x", times, ones, 0.0 * ones)) is None
    half = consistency(curves.Curve("x", times, np.where(times < 50, 0.0, 1.0), np.where(times < 50, 0.0, 2.0)))
    assert half.samples == 50 and half.square == pytest.approx(1.0)


def test_values_that_are_held_between_steps_are_no_samples():
    slow = made()
    facts = {name: {**fact, "step": 4} for name, fact in slow.run.components.items()}
    found = panels(shown(replace(slow, run=replace(slow.run, components=facts))))
    innovation = next(p for p in found if p.title == "innovation").curves[0]
    assert innovation.times == pytest.approx(slow.times[4::4])
    assert consistency(innovation).samples == 100


def test_many_signals_of_a_unit_are_parted_by_variable():
    rows = np.linspace(0.0, 1.0, 11)
    signals = {f"plant.{a}_{k}": rows + k for a in "ab" for k in range(5)}
    found = panels(shown(made(11, signals)))
    assert [len(p.curves) for p in found] == [1] * 10


def test_errors_are_those_of_the_metrics_of_the_scenario(fmus):
    """Also where an estimate is of an earlier time: the root mean square of what is drawn is the metric's value."""
    result = run(SCENARIOS / "semera_valve", fmus=fmus)
    scenario = load(SCENARIOS / "semera_valve")
    found = {c.name: c for p in panels(shown(result, scenario)) if p.is_error for c in p.curves}
    checked = [m for m in scenario.metrics if m.kind == "rmse"]
    for m in checked:
        curve = found[m.signal]
        inside = (curve.times > m.after + 1e-9) & (curve.times < m.before - 1e-9)
        assert rms(curve.values[inside]) == pytest.approx(result.metrics[m.name].value, rel=1e-9), m.name
    assert len(checked) == 18


@pytest.fixture(scope="module")
def made_once(fmus, tmp_path_factory) -> Path:
    """A folder with a scenario, its baseline and a result of it."""
    folder = tmp_path_factory.mktemp("saved")
    shutil.copytree(SCENARIOS / "pot_magnet", folder / "pot_magnet")
    run(folder / "pot_magnet", "off", fmus=fmus).save(folder / "results" / "off.csv")
    return folder


@pytest.fixture
def saved(made_once, tmp_path) -> Path:
    """A result of a scenario beside it, and its baseline, to be changed."""
    return shutil.copytree(made_once, tmp_path / "saved") / "results" / "off.csv"


def test_tubes_fail_at_the_rows_at_which_the_regression_test_fails(saved):
    result = read_result(saved)
    name = "magnet.position"
    signals = {**result.signals, name: result[name] + np.where(result.times > 0.5, 1e-5, 0.0)}
    replace(result, signals=signals).save(saved)
    (one,) = read_all([saved])
    found = regression(one)
    assert len(found.problems) == 1  # the sentence of `gapsense test`
    worst = found.tubes[0]
    rows = int(worst.failing.sum())
    assert worst.name == name and f"{rows} of {worst.values.size} rows" in found.problems[0]
    assert worst.share > 1.0 and not any(tube.failing.any() for tube in found.tubes[1:])


def test_values_that_are_no_number_leave_the_tube(saved):
    (one,) = read_all([saved])
    tube = replace(regression(one).tubes[0], values=np.full_like(regression(one).tubes[0].values, np.nan))
    assert tube.failing.all() and tube.share == np.inf


def test_baseline_is_left_out_with_a_reason(saved):
    (one,) = read_all([saved])
    assert one.note == "" and regression(one).tubes and not regression(one).problems
    other = replace(one, result=replace(one.result, run=replace(one.result.run, seeds={"sensor": 7})))
    assert "other values or seeds" in regression(other).note
    file = saved.parents[1] / "pot_magnet" / "scenario.toml"
    file.write_text(file.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    (one,) = read_all([saved])
    assert one.scenario is None and "has changed since it ran" in regression(one).note
    file.write_text("no toml", encoding="utf-8")
    assert "can no longer be read" in read_all([saved])[0].note
    file.unlink()
    assert "not where it was" in read_all([saved])[0].note


def test_runs_of_a_sweep_are_not_held_against_the_baseline_but_for_the_one_that_is_as_the_scenario(saved):
    (one,) = read_all([saved])
    port = Port("magnet", "coil.resistance")
    value = one.scenario.components["magnet"].values[port.variable]
    scenario = replace(one.scenario, grid={port: (value, 2.0)})
    assert not replace(one, scenario=scenario).is_changed  # run as it is
    other = replace(one.result, parameters={**one.result.parameters, str(port): 2.0})
    assert replace(one, scenario=scenario, result=other).is_changed


def test_events_are_shaded_to_the_end_of_the_run_where_they_do_not_say():
    spans = (Span("a", "x.y", "set", 0.0, 1e-2), Span("b", "x.y", "set", 1e-2, None))
    result = replace(made(), events=spans)
    assert make_time_axis(shown(result), {}, 100).events == ((0.0, 1e-2), (1e-2, result.run.stop))
    assert make_time_axis(shown(made()), {}, 100).events == ()


NAMES = tuple("abcdefghijkl")


@st.composite
def wirings(draw):
    count = draw(st.integers(1, 12))
    ends = st.tuples(st.sampled_from(NAMES[:count]), st.sampled_from(["x", "y", "long_name"]))
    return count, [Wire(*pair, "held") for pair in draw(st.lists(st.tuples(ends, ends), max_size=25))]


@given(wirings())
def test_boxes_never_overlap_and_wires_that_go_on_go_to_the_right(wiring):
    count, wires = wiring
    boxes, ways = arrange_boxes({name: (name, "fmu") for name in NAMES[:count]}, wires)
    assert [wire for wire, _ in ways] == wires
    placed = list(boxes.values())
    for k, a in enumerate(placed):
        for b in placed[k + 1 :]:
            apart = a.x + a.across <= b.x or b.x + b.across <= a.x
            assert apart or a.y + a.height <= b.y + 1e-6 or b.y + b.height <= a.y + 1e-6, (a, b)
    for _, names in ways:
        xs = [boxes[name].x for name in names]
        assert xs == sorted(set(xs))
    for wire, names in ways:
        assert boxes[wire.target[0]].port(wire.target[1], True) > boxes[wire.target[0]].y
        assert not names or (names[0], names[-1]) == (wire.source[0], wire.target[0])
