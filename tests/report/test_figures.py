"""Figures of runs."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

from gapsense.cosim import load, run
from gapsense.report import plot as figures
from gapsense.scenarios.semera_valve.show import LABELS, snr
from gapsense.studies import drawer

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.mark.parametrize("name", ["valve", pytest.param("relay", marks=pytest.mark.slow)])
def test_figure_of_each_scenario_is_a_picture_of_sensible_size(request, name, tmp_path):
    figure = drawer("semera")(request.getfixturevalue(name))
    file = figures.save(figure, tmp_path / "new" / f"{name}.png")
    height, width = imread(file).shape[:2]
    assert 800 <= width <= 2000 and 800 <= height <= 2500
    assert 30_000 < file.stat().st_size < 1_000_000
    assert [p.name for p in file.parent.iterdir()] == [file.name]


def test_figure_3_of_semera_has_its_panels_and_curves(valve):
    figure = drawer("semera")(valve)
    assert [axis.get_ylabel() for axis in figure.axes] == LABELS
    assert figure.get_suptitle() == valve.run.title
    assert [line.get_label() for line in figure.axes[3].lines] == ["offline integral", "integral", "SEMERA", "true"]
    high, low = figure.axes[1].lines
    assert high.get_xdata().size + low.get_xdata().size == valve.stepped("semera.quality").sum()
    truth = figure.axes[4].lines[-1].get_ydata()
    assert np.array_equal(truth, 1e3 * valve["valve.flux_linkage"][valve.stepped("sensor.current_measured")])


def test_overview_shows_every_signal_once_in_display_units(valve):
    figure = drawer("overview")(valve)
    labels = [line.get_label() for axis in figure.axes for line in axis.lines]
    assert sorted(labels) == sorted(valve.signals)
    panel = next(axis for axis in figure.axes if axis.get_ylabel() == "position / mm")
    assert panel.lines[0].get_ydata().max() == pytest.approx(0.9)
    assert figure.axes[-1].get_xlabel() == "time / ms"


def test_overview_of_many_components_has_few_curves_per_panel_and_no_label_on_another(valve):
    names = [f"estimator_{k}.{variable}" for k in range(12) for variable in ("flux_linkage", "smoothed_position")]
    about = {name: replace(valve.about["valve.flux_linkage"], unit="m" if "pos" in name else "Wb") for name in names}
    signals = {name: valve["valve.flux_linkage"] for name in names}
    figure = drawer("overview")(replace(valve, signals=signals, about=about))
    assert [len(axis.lines) for axis in figure.axes] == [5, 5, 2, 5, 5, 2]
    assert {axis.get_ylabel() for axis in figure.axes} == {"flux linkage\n/ mWb", "smoothed\nposition / mm"}
    assert no_texts_overlap(figure)


def no_texts_overlap(figure: Figure) -> bool:
    """Labels of the axes and legends, as drawn."""
    FigureCanvasAgg(figure).draw()
    boxes = [axis.yaxis.label.get_window_extent() for axis in figure.axes]
    boxes += [axis.get_legend().get_window_extent() for axis in figure.axes if axis.get_legend()]
    return not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def test_figure_of_the_bounded_filter_names_its_axes_and_has_a_panel_of_errors(fmus):
    result = run(SCENARIOS / "bounded_ukf", fmus=fmus)
    figure = drawer(load(SCENARIOS / "bounded_ukf").figure)(result)
    named = [" ".join(axis.get_ylabel().split()) for axis in figure.axes]
    assert named[2:] == ["position / mm", "error of the position / µm", "error of the flux linkage / µWb"]
    errors = {line.get_label(): line.get_ydata() for line in figure.axes[3].lines}
    assert np.array_equal(errors["open loop"], 1e6 * (result["model.position"] - result["valve.position"]))
    assert len(errors) == 4 and no_texts_overlap(figure)
    with pytest.raises(ValueError, match=r"needs `ekf\.position`, not recorded"):
        drawer("bounded_ukf")(replace(result, signals={n: v for n, v in result.signals.items() if n != "ekf.position"}))


@pytest.mark.parametrize(
    ("variables", "unit", "text"),
    [
        (["position", "position_std"], "m", "position / mm"),
        (["voltage", "current"], "V", "voltage / V"),
        (["velocity"], "m/s", "velocity\n/ (m/s)"),
        (["mode"], "1", "mode"),
        (["mode", "health"], "1", "mode, health"),
        (["core.field"], "A/m", "core field\n/ (A/m)"),
        (["speed"], "furlong", "speed\n/ furlong"),
    ],
)
def test_axes_are_named_by_quantity_and_unit(variables, unit, text):
    assert figures.label(variables, unit) == text


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_ending_says_the_format(tmp_path, ending, head):
    file = figures.save(figures.stack("empty", ["a", "b"])[0], tmp_path / f"x.{ending}")
    assert file.read_bytes().startswith(head)


def test_same_figure_gives_the_same_bytes(tmp_path):
    files = [figures.save(figures.stack("empty", ["a"])[0], tmp_path / f"{k}.png") for k in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_failed_drawing_keeps_the_old_file(tmp_path, monkeypatch):
    old = tmp_path / "x.png"
    old.write_bytes(b"old")

    def fail(self, file, **_):
        file.write(b"half")
        raise RuntimeError("no fonts")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(RuntimeError, match="no fonts"):
        figures.save(Figure(), old)
    assert [p.name for p in tmp_path.iterdir()] == ["x.png"] and old.read_bytes() == b"old"


def test_other_endings_and_figures_are_refused_with_what_there_is(valve, tmp_path):
    with pytest.raises(ValueError, match=r"x\.bmp`: figures are written as \.png, \.pdf or \.svg"):
        figures.save(Figure(), tmp_path / "x.bmp")
    with pytest.raises(ValueError, match=r"figure `pie`; there are overview, .*, condition, .*, semera, "):
        drawer("pie")(valve)


def test_figure_names_the_signals_it_lacks(valve):
    signals = {n: v for n, v in valve.signals.items() if n not in ("offline.published", "valve.inductance")}
    with pytest.raises(ValueError, match=r"needs `valve\.inductance`, `offline\.published`, not recorded"):
        drawer("semera")(replace(valve, signals=signals))


def test_signal_to_noise_ratio_is_in_decibels_and_finite():
    assert snr(np.array([10.0, 1.0, 0.0, 1.0]), np.array([1.0, 10.0, 1.0, 0.0])) == pytest.approx([20, -20, -20, 140])
