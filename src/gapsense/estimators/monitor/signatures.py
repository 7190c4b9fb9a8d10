"""Signatures of causes: which way innovations and learnt values go.

`SUDDEN` are mean innovations of the first closing with a fault: before the motion, in it, after the landing, at rest.
Those of the first opening follow, which counts no more than a closing before it.  `GRADUAL` are learnt values (eddy
currents, gap factor, knee, saturation, hysteresis, mass, rest position) in usual wanderings.  Only directions count.
`python -m gapsense.scenarios.condition.fit` has found them, with seeds 21 to 23, and those of a stuck mover with 31 to
35 too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from gapsense.kernels.linalg import total


class Signature(NamedTuple):
    """A direction, and how far it differs from device to device, both in hundredths; a cause may have several."""

    cause: str
    entries: tuple[float, ...]
    spreads: tuple[float, ...]  # of each entry


CAUSES_TOLD = {
    "stuck_upper": "stuck at the upper stop",
    "stuck_lower": "stuck at the lower stop",
    "lower_stop": "lower stop higher",
    "upper_stop": "upper stop lower",
    "spring": "spring weaker or broken",
    "turns": "turns shorted",
    "contact": "resistance in the circuit higher at once, as of a contact",
    "open": "circuit open",
    "supply": "voltage lower than measured",
    "gain": "current sensor reads too little",
    "friction": "friction, damping or mass higher",
    "still": "no voltage, or none that moves the device",
}
CAUSES = tuple(CAUSES_TOLD)  # in the order of their numbers, from 1 on
MISSING = ("open", "still")  # known by what is not there: a current, a motion
COLDER = (0.10, 0.43, 0.88)  # of a closing with a coil that has cooled, up to the rest
SUDDEN = (
    Signature("stuck_upper", (-1, 75, 50, 1, 1, -37, -23, -1), (5, 5, 8, 5, 5, 5, 5, 5)),
    Signature("stuck_upper", (1, 66, 60, 1, 1, 38, -26, 0), (5, 6, 6, 5, 5, 6, 13, 5)),
    Signature("stuck_upper", (-1, 68, 17, -5, 50, -49, -12, 0), (5, 5, 6, 9, 5, 5, 5, 5)),
    Signature("stuck_upper", (1, 57, 54, 1, 0, 26, -56, 0), (5, 6, 6, 5, 5, 8, 8, 5)),
    Signature("stuck_upper", (1, 50, 54, 1, 39, -54, -12, 0), (5, 5, 7, 5, 9, 5, 5, 5)),
    Signature("stuck_lower", (-91, 23, 31, 0, 0, -11, 3, 2), (5, 5, 6, 5, 5, 5, 5, 5)),
    Signature("lower_stop", (4, 46, 52, -5, 61, -32, -17, 0), (7, 5, 5, 7, 5, 5, 5, 5)),
    Signature("lower_stop", (5, 14, 13, -13, 84, -44, -23, 0), (7, 5, 5, 6, 5, 6, 5, 5)),
    Signature("lower_stop", (-31, 39, 48, -8, 63, -30, -15, 0), (9, 6, 5, 10, 5, 5, 5, 5)),
    Signature("upper_stop", (-92, -15, 37, -2, -1, -3, -1, 1), (5, 11, 7, 5, 5, 5, 5, 5)),
    Signature("spring", (-3, -61, 48, -2, -1, -60, 15, 13), (5, 6, 5, 5, 5, 7, 5, 5)),
    Signature("spring", (2, -64, 49, -4, -2, -46, 37, 2), (7, 6, 5, 5, 5, 6, 5, 5)),
    Signature("turns", (51, 50, 50, 49, -3, -2, -1, 0), (5, 5, 5, 5, 5, 5, 5, 5)),
    Signature("turns", (38, 39, 39, 38, 0, 0, -64, 0), (5, 5, 5, 5, 5, 5, 14, 5)),
    Signature("turns", (37, 39, 41, 37, -63, -1, -5, 0), (5, 5, 5, 5, 9, 5, 5, 5)),
    Signature("contact", (-8, -36, -69, -60, -17, -6, -2, 0), (5, 5, 5, 5, 5, 5, 5, 5)),
    Signature("supply", (-22, -41, -68, -55, -7, -1, 0, 0), (5, 5, 5, 5, 5, 5, 5, 5)),
    Signature("gain", (-23, -50, -58, -58, -18, -5, 0, 0), (5, 5, 5, 5, 5, 5, 5, 5)),
    Signature("friction", (3, 79, -51, -2, 1, -25, 23, 1), (5, 5, 5, 5, 6, 5, 5, 5)),
    Signature("friction", (7, 85, -48, -5, -1, -15, 13, 0), (6, 5, 5, 5, 5, 5, 5, 5)),
    Signature("friction", (0, 85, -45, 4, 22, -5, 12, 2), (9, 5, 5, 13, 9, 6, 5, 5)),
    Signature("friction", (27, 82, -44, -1, 14, -9, 16, 1), (10, 6, 7, 15, 9, 8, 5, 7)),
    Signature("friction", (1, 80, -54, -1, 1, -19, 17, 1), (6, 5, 5, 5, 5, 5, 5, 5)),
)
GRADUAL = (
    Signature("lower_stop", (51, 57, -10, -45, -21, 24, -31), (32, 19, 15, 24, 14, 10, 13)),
    Signature("spring", (10, 19, -17, -21, -17, -9, -92), (12, 15, 12, 15, 11, 29, 17)),
    Signature("turns", (72, 64, 6, -24, 6, 0, 7), (5, 5, 5, 5, 5, 5, 5)),
    Signature("gain", (-4, -80, -10, 4, 10, -27, -51), (13, 9, 6, 7, 27, 10, 12)),
    Signature("friction", (6, -27, 31, 25, 21, 81, -23), (17, 16, 14, 13, 21, 21, 43)),
    Signature("friction", (-5, -18, 16, 15, 13, 93, 20), (9, 10, 13, 10, 8, 14, 15)),
    Signature("friction", (37, 11, 7, -29, -26, 47, -69), (29, 13, 13, 26, 17, 16, 22)),
)


def direction(entries: Sequence[float]) -> tuple[float, ...]:
    """A signature of length 1."""
    length = math.sqrt(total(x * x for x in entries))
    return tuple(x / length for x in entries)
