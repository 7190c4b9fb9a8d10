"""Readings that an estimator can use, and causes of bad health.

Every estimator has the outputs `health`, 1 or 0, and `health_causes`, the sum of the bits of `CAUSES` that hold.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from gapsense.kernels.interface import input_, measured, output, parameter, ports, same
from gapsense.kernels.layout import Scalar
from gapsense.kernels.linalg import total
from gapsense.kernels.trace import fabs, where

INNOVATION, CURRENT_ERROR, SATURATION, BOUND, LOST, RESTARTED, STILL, OTHER, UNTOLD, IMPACT, UNLEARNT, CHANGING = (
    float(2**k) for k in range(12)
)
CAUSES = {
    INNOVATION: "innovations larger than expected",
    CURRENT_ERROR: "current error larger than expected",
    SATURATION: "flux linkage beyond saturation",
    BOUND: "position held at a bound for long",
    LOST: "a reading lost or wild",
    RESTARTED: "covariance lost, restarted",
    STILL: "no motion after a command",
    OTHER: "device far from the one told",
    UNTOLD: "noise or switching larger than told",
    IMPACT: "first impact perhaps missed by the contact",
    UNLEARNT: "device not learnt yet, operate it twice",
    CHANGING: "what was learnt keeps changing",
}
WHY_NOT = "Why not, a sum of " + ", ".join(f"{bit:.0f}: {cause}" for bit, cause in CAUSES.items())
JUMP = 6.0 * 2.0**0.5  # noises of a voltage's change that are no edge
TWICE = 2.0  # motion and eddy currents drive more current than the voltage alone


# ports that estimators share
VOLTAGE = measured("V", "Measured coil voltage; NaN where it was lost", nominal=30.0)
CURRENT = measured("A", "Measured coil current; NaN where it was lost", nominal=0.4)
RESISTANCE = input_(
    "Ohm",
    "Resistance that is known from elsewhere; `coil.resistance` counts where this is not positive and finite",
    nominal=48.0,
    is_optional=True,
)
RANGE_VOLTAGE = parameter("V", "A reading beyond plus or minus this counts as lost", 100.0, min=1e-9)
RANGE_CURRENT = parameter(
    "A", "A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives", 0.0, min=0.0
)
RANGE_INNOVATION = parameter(
    "1",
    "A current with an innovation beyond so many deviations is wild, but not more than 5 in a row; 0: none is",
    50.0,
    min=0.0,
)


@ports()
class Health(NamedTuple):
    """Health of an estimator, by its own judgement."""

    health: Scalar = output("1", "1: to be trusted as far as the filter can tell; 0: not", min=0.0, max=1.0)
    health_causes: Scalar = output("1", WHY_NOT, min=0.0, max=2.0 * max(CAUSES) - 1.0)


HEALTH = same(Health)


def health(found: Mapping[float, Scalar]) -> Health:
    """Health by the truth values of some causes, by bit."""
    causes = total(where(is_so, bit, 0.0) for bit, is_so in found.items())
    return Health(where(causes > 0.0, 0.0, 1.0), causes)


def worse(before: Health, bit: float, is_so: Scalar) -> Health:
    """Health with one cause more, if it holds."""
    return Health(where(is_so > 0.0, 0.0, before.health), before.health_causes + where(is_so > 0.0, bit, 0.0))


def can_be_read(value: Scalar, limit: Scalar) -> Scalar:
    """Neither NaN nor infinite nor beyond plus or minus `limit`."""
    return (value > -limit) & (value < limit)


def is_edge(change: Scalar, edge: Scalar, noise_voltage: Scalar) -> Scalar:
    """Whether a voltage, or its change, is larger than noise makes it, by more than `edge`."""
    return fabs(change) > edge + JUMP * noise_voltage


def is_mode(value: Scalar) -> Scalar:
    """1, 2 or 3, as near as the filters tell them apart: what a contact sensor says."""
    return (value > 0.5) & (value < 3.5)


def most_current(range_current: Scalar, range_voltage: Scalar, resistance: Scalar) -> Scalar:
    """Limit of a current reading [A]: the parameter, or, where that is 0, twice what the voltage's limit can drive."""
    return where(range_current > 0.0, range_current, TWICE * range_voltage / resistance)


def believed_resistance(resistance: Scalar, parameter: Scalar) -> Scalar:
    """Resistance at an input [ohm]; the parameter if the input is not wired, lost, or not positive and finite."""
    return where((resistance > 0.0) & (resistance < math.inf), resistance, parameter)
