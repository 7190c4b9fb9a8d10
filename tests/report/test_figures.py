"""Figures of runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from gapsense.report import plot as figures
from gapsense.studies.figures import drawer
from gapsense.studies.semera.show import LABELS, snr


@pytest.mark.parametrize("name", ["valve", "relay"])
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
    panel = next(axis for axis in figure.axes if axis.get_ylabel() == "mm")
    assert panel.lines[0].get_ydata().max() == pytest.approx(0.9)
    assert figure.axes[-1].get_xlabel() == "time / ms"


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
    with pytest.raises(ValueError, match=r"figure `pie`; there are overview, estimators, .*, semera, "):
        drawer("pie")(valve)


def test_figure_names_the_signals_it_lacks(valve):
    signals = {n: v for n, v in valve.signals.items() if n not in ("offline.published", "valve.inductance")}
    with pytest.raises(ValueError, match=r"needs `valve\.inductance`, `offline\.published`, not recorded"):
        drawer("semera")(replace(valve, signals=signals))


def test_signal_to_noise_ratio_is_in_decibels_and_finite():
    assert snr(np.array([10.0, 1.0, 0.0, 1.0]), np.array([1.0, 10.0, 1.0, 0.0])) == pytest.approx([20, -20, -20, 140])
