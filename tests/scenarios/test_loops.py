"""The loops of the scenarios are those of the textbook, and their areas are what the actuators say they lose."""

import sys
from pathlib import Path

import numpy as np
import pytest

from gapsense.cosim import run
from gapsense.cosim.result.metrics import intercept, loop_area

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "oracles"))
from jiles_atherton import closed_loop  # noqa: E402

CORE = (1.45e6, 1949.6, 3.66e-3, 942.0, 0.736)  # [RTS] Table I: M_sat, a, alpha, kappa, c
VOLUME = 0.055 * 1.26e-5


@pytest.fixture(scope="module")
def fmus(natives):
    """Native ones, which have the bits of the Python ones in all scenarios: tests/native/test_scenarios.py."""
    return natives


@pytest.fixture(scope="module")
def loops(fmus):
    return run(ROOT / "scenarios" / "hysteresis_loops", None, fmus)


@pytest.mark.parametrize(("name", "tolerance"), [("major", 2e-4), ("large", 2e-4), ("medium", 2e-4), ("small", 0.02)])
def test_symmetric_loops_are_those_of_the_textbook(loops, name, tolerance):
    """The small loop still creeps: it is at its second period, and its peaks differ."""
    rows = loops.times > 49.99e-3
    H, B = loops[f"{name}.core_field"][rows], loops[f"{name}.flux_density"][rows]
    field, density = closed_loop(np.abs(H).max(), CORE, cycles=2)
    for kind, y, x in ((intercept, (H, field), (B, density)), (intercept, (B, density), (H, field))):
        assert kind(y[0], x[0]) == pytest.approx(kind(y[1], x[1]), rel=tolerance)
    assert loop_area(B, H) == pytest.approx(loop_area(density, field), rel=1.2 * tolerance)


@pytest.mark.parametrize("name", ["major", "large", "medium"])
def test_loss_is_the_area_of_the_loop(loops, name):
    area, loss = (loops.metrics[f"{name}_{what}"].value for what in ("area", "loss"))
    assert area * VOLUME == pytest.approx(loss, rel=3e-4)


def test_plungers_stay_locked(loops, fmus):
    for result in (loops, run(ROOT / "scenarios" / "locked_plunger", None, fmus)):
        positions = [name for name in result.signals if name.endswith(".position")]
        assert len(positions) >= 5
        for name in positions:
            assert np.ptp(result[name]) == 0.0


def test_area_of_flux_linkage_over_current_is_what_the_core_loses(fmus):
    """But for 10 uJ in each of the two corners that the samples cut off where the voltage jumps."""
    result = run(ROOT / "scenarios" / "locked_plunger", None, fmus)
    for gap in ("gap_040", "gap_140"):
        area, *parts = (result.metrics[f"{gap}_{what}"].value for what in ("area", "hysteresis", "eddy"))
        assert area + 2 * 9.6e-6 == pytest.approx(sum(parts), abs=2e-6)
