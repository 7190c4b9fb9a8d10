"""Estimators with a contact on an actuator that bounces: they see what the contact tells, and are right at rest."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from c_code import driven
from c_code import run as run_in_c

from gapsense.actuators import reluctance_actuator
from gapsense.estimators import ekf, ertss
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.layout import names
from gapsense.scenarios.estimators.parameters import VALVE, blind
from gapsense.sensor import sensor
from gapsense.studies.devices import RTS_VALVE

T_S, NEAR = 20e-6, 5e-6  # sampling period; distance of a stop at which its contact closes [m]
VOLTAGE = np.tile(np.repeat([30.0, 0.0], 500), 3)
BOUNCING = pytest.mark.parametrize("restitution", [0.3, 0.5])


@cache
def plant(restitution: float) -> dict[str, np.ndarray]:
    """The actuator, and what a sensor with contacts measures of it."""
    signals = ("current", "position", "mode")
    par = RTS_VALVE._replace(stop_restitution=restitution)
    true = dict(zip(signals, driven(reluctance_actuator, par, VOLTAGE, T_S, *signals).T))
    edges = {"contact_lower": par.stop_lower + NEAR, "contact_upper": par.stop_upper - NEAR, "contact_hysteresis": 2e-6}
    told = kernel_parameters(own("sensor"), {})._replace(sample_time=T_S, contact_source=1.0, seed=1.0, **edges)
    seen = run(sensor, told, {"voltage": VOLTAGE, **true})
    return {**true, "measured": seen["current_measured"], "contact": seen["mode_measured"]}


def run(module: Any, par: Any, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Outputs of a kernel by name."""
    known = {"time": T_S * np.arange(VOLTAGE.size), **given}
    columns = {name: known.get(name, np.zeros(VOLTAGE.size)) for name in names(module.Inputs)}
    return dict(zip(names(module.Outputs), run_in_c(module, np.column_stack([*columns.values()]), par).T))


def estimated(module: Any, s: dict[str, np.ndarray], **changes: float) -> dict[str, np.ndarray]:
    par = kernel_parameters(own(module.__name__.rpartition(".")[2]), blind(VALVE) | changes)
    return run(module, par, {"voltage": VOLTAGE, "current": s["measured"], "mode": s["contact"]})


@BOUNCING
def test_a_filter_is_right_again_at_rest(restitution: float) -> None:
    """In motion it has 19 um without bounces, 20 and 39 um with them, by the true mode; here the contact is late."""
    s = plant(restitution)
    found = estimated(ekf, s)
    at_rest = (s["mode"] != 2.0) & (s["contact"] != 2.0)
    assert np.abs(found["position"] - s["position"])[at_rest].max() < 2.0 * NEAR
    assert np.sqrt(np.mean((found["position"] - s["position"])[s["mode"] == 2.0] ** 2)) < 0.2e-3


@BOUNCING
def test_a_smoother_tells_the_bounces_that_the_contact_has_seen(restitution: float) -> None:
    """The speed is that of the first impact that was seen: of an opening the same as without bounces."""
    s, still = plant(restitution), plant(0.0)
    found, before = estimated(ertss, s, **{"contact.debounce": 2e-3}), estimated(ertss, still)
    assert found["bounces"].max() >= 1.0 and before["bounces"].max() == 0.0
    assert found["impact_speed"][-1] == pytest.approx(before["impact_speed"][-1], rel=0.02)
