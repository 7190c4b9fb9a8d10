"""Signatures of causes: which way innovations and learnt values go.

`SUDDEN` are mean innovations of the first closing with a fault (before the motion, in it, after the landing, in the
rest) and of the first opening.  `GRADUAL` are learnt values (eddy currents, gap factor, knee, saturation, hysteresis,
mass, rest position) in usual wanderings.  Only directions count.  `python -m gapsense.scenarios.condition.fit` has
found them, with seed 21; the spread of `stuck_upper` is twice what it found, since `Mhe` goes on in many ways then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from gapsense.kernels.linalg import total


class Signature(NamedTuple):
    """A direction, and how far it differs from device to device; a cause may have several."""

    cause: str
    spread: float  # of an entry of the direction [1]
    entries: tuple[float, ...]


CAUSES = (
    *("stuck_upper", "stuck_lower", "lower_stop", "upper_stop", "spring", "turns"),
    *("contact", "open", "supply", "gain", "friction", "still"),
)  # in the order of their numbers, from 1 on
COLDER = (0.10, 0.43, 0.88)  # of a closing with a coil that has cooled, up to the rest
SUDDEN = (
    Signature("stuck_upper", 0.12, (0.010, 0.483, 0.421, 0.007, 0.486, -0.580, -0.130, -0.002)),
    Signature("stuck_upper", 0.12, (0.015, 0.670, 0.594, 0.007, 0.003, 0.357, -0.264, 0.002)),
    Signature("stuck_upper", 0.12, (0.007, 0.579, 0.527, 0.007, 0.004, 0.188, -0.592, 0.001)),
    Signature("stuck_lower", 0.05, (-0.918, 0.239, 0.293, 0.004, 0.0, -0.114, 0.029, 0.024)),
    Signature("lower_stop", 0.07, (0.069, 0.130, 0.125, -0.082, 0.841, -0.443, -0.230, -0.004)),
    Signature("upper_stop", 0.06, (-0.930, -0.117, 0.346, -0.015, -0.009, -0.029, -0.013, 0.006)),
    Signature("spring", 0.06, (-0.027, -0.573, 0.470, -0.017, -0.012, -0.636, 0.159, 0.136)),
    Signature("spring", 0.06, (0.037, -0.606, 0.491, -0.031, -0.028, -0.482, 0.393, 0.022)),
    Signature("turns", 0.05, (0.513, 0.501, 0.496, 0.487, -0.040, -0.017, -0.011, 0.001)),
    Signature("contact", 0.05, (-0.081, -0.356, -0.689, -0.599, -0.171, -0.055, -0.018, 0.0)),
    Signature("supply", 0.05, (-0.225, -0.411, -0.685, -0.554, -0.069, -0.007, -0.003, 0.0)),
    Signature("open", 0.05, (-0.243, -0.507, -0.584, -0.581, -0.066, -0.019, -0.002, 0.0)),
    Signature("gain", 0.05, (-0.236, -0.501, -0.578, -0.566, -0.188, -0.059, -0.003, 0.001)),
    Signature("friction", 0.05, (0.041, 0.793, -0.508, -0.015, 0.003, -0.249, 0.220, 0.011)),
    Signature("friction", 0.06, (0.032, 0.854, -0.480, -0.025, 0.027, -0.133, 0.141, 0.009)),
    Signature("friction", 0.05, (0.030, 0.805, -0.531, -0.008, 0.003, -0.204, 0.162, 0.017)),
)
GRADUAL = (
    Signature("spring", 0.18, (0.057, 0.208, -0.242, -0.289, -0.143, -0.104, -0.883)),
    Signature("turns", 0.07, (0.670, 0.677, 0.081, -0.222, 0.149, -0.024, 0.119)),
    Signature("supply", 0.20, (0.046, -0.699, -0.027, 0.519, -0.138, 0.315, 0.356)),
    Signature("gain", 0.19, (-0.084, -0.808, -0.115, 0.056, 0.240, -0.218, -0.468)),
    Signature("friction", 0.17, (-0.027, -0.336, 0.310, 0.297, 0.313, 0.775, 0.049)),
    Signature("friction", 0.16, (-0.020, -0.273, 0.247, 0.186, 0.203, 0.825, 0.327)),
)


def direction(entries: Sequence[float]) -> tuple[float, ...]:
    """A signature of length 1."""
    length = math.sqrt(total(x * x for x in entries))
    return tuple(x / length for x in entries)
