"""The figure of the pot magnet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gapsense.scenarios.pot_magnet.figure import LABELS, last_edge
from gapsense.studies import drawer


def test_figures_4_to_7_have_their_panels_and_curves(magnet):
    figure = drawer("pot_magnet")(magnet)
    assert [axis.get_ylabel() for axis in figure.axes] == LABELS
    for axis in figure.axes[1:]:
        assert [line.get_label() for line in axis.lines][-4:] == ["true", "paper", "robust", "open loop"]
    times, truth = figure.axes[2].lines[0].get_data()
    assert truth.max() == pytest.approx(0.2) and truth[-1] == 0.0
    assert times[0] == pytest.approx(497.0, abs=0.2) and times[-1] == pytest.approx(532.0, abs=0.2)


def test_edge_is_that_of_the_voltage(magnet):
    assert last_edge(magnet) == pytest.approx(0.4999)
    held = replace(magnet, signals={**magnet.signals, "drive.voltage": np.zeros(magnet.times.size)})
    assert last_edge(held) == 0.0


def test_figure_names_the_signals_it_lacks(magnet):
    signals = {n: v for n, v in magnet.signals.items() if n not in ("magnet.mode", "paper.position")}
    with pytest.raises(ValueError, match=r"needs `magnet\.mode`, `paper\.position`, not recorded"):
        drawer("pot_magnet")(replace(magnet, signals=signals))
