"""Signatures of causes: which way innovations and learnt values go.

`SUDDEN` are mean innovations of the first closing with a fault (before the motion, in it, after the landing, in the
rest) and of the first opening, which counts no more than a closing before it.  `GRADUAL` are learnt values (eddy
currents, gap factor, knee, saturation, hysteresis, mass, rest position) in usual wanderings.  Only directions count.
`python -m gapsense.scenarios.condition.fit` has found them, with seeds 21 to 23.
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
MISSING = ("open", "still")  # known by what is not there: a current, a motion
COLDER = (0.10, 0.43, 0.88)  # of a closing with a coil that has cooled, up to the rest
SUDDEN = (
    Signature("stuck_upper", 0.08, (0.008, 0.516, 0.535, 0.007, 0.383, -0.534, -0.120, -0.003)),
    Signature("stuck_upper", 0.08, (0.0, 0.497, -0.750, 0.007, 0.003, 0.237, -0.366, 0.001)),
    Signature("stuck_upper", 0.08, (0.008, 0.653, 0.553, 0.008, 0.005, 0.360, -0.371, 0.002)),
    Signature("stuck_upper", 0.08, (0.006, 0.536, 0.547, 0.008, 0.004, 0.241, -0.596, 0.0)),
    Signature("stuck_upper", 0.08, (-0.010, 0.681, 0.158, -0.070, 0.505, -0.488, -0.117, -0.003)),
    Signature("stuck_upper", 0.08, (0.002, 0.675, 0.605, 0.008, 0.005, 0.412, -0.090, 0.002)),
    Signature("stuck_lower", 0.08, (-0.917, 0.235, 0.299, 0.005, 0.001, -0.115, 0.029, 0.024)),
    Signature("lower_stop", 0.08, (0.038, 0.465, 0.524, -0.049, 0.612, -0.322, -0.167, -0.003)),
    Signature("lower_stop", 0.08, (0.054, 0.140, 0.131, -0.133, 0.837, -0.437, -0.226, -0.005)),
    Signature("lower_stop", 0.08, (-0.308, 0.394, 0.481, -0.083, 0.632, -0.299, -0.148, -0.005)),
    Signature("upper_stop", 0.08, (-0.918, -0.147, 0.366, -0.019, -0.007, -0.030, -0.009, 0.006)),
    Signature("spring", 0.08, (-0.031, -0.610, 0.480, -0.024, -0.007, -0.598, 0.145, 0.127)),
    Signature("spring", 0.08, (0.018, -0.639, 0.493, -0.037, -0.016, -0.457, 0.372, 0.018)),
    Signature("turns", 0.08, (0.508, 0.498, 0.502, 0.490, -0.025, -0.016, -0.010, -0.001)),
    Signature("turns", 0.08, (0.381, 0.389, 0.393, 0.378, 0.001, 0.0, -0.637, 0.0)),
    Signature("turns", 0.08, (0.374, 0.393, 0.411, 0.369, -0.631, -0.011, -0.048, 0.0)),
    Signature("contact", 0.08, (-0.080, -0.356, -0.688, -0.601, -0.169, -0.057, -0.020, -0.001)),
    Signature("supply", 0.08, (-0.223, -0.412, -0.685, -0.554, -0.068, -0.008, -0.003, 0.0)),
    Signature("gain", 0.08, (-0.233, -0.496, -0.575, -0.576, -0.183, -0.054, -0.003, 0.0)),
    Signature("friction", 0.08, (0.033, 0.790, -0.513, -0.025, 0.011, -0.246, 0.225, 0.007)),
    Signature("friction", 0.08, (0.066, 0.848, -0.484, -0.048, -0.014, -0.147, 0.132, -0.001)),
    Signature("friction", 0.08, (0.001, 0.855, -0.449, 0.039, 0.223, -0.053, 0.116, 0.015)),
    Signature("friction", 0.09, (0.268, 0.824, -0.442, -0.009, 0.144, -0.090, 0.158, 0.007)),
    Signature("friction", 0.08, (0.009, 0.801, -0.540, -0.011, 0.006, -0.193, 0.168, 0.014)),
)
GRADUAL = (
    Signature("lower_stop", 0.20, (0.511, 0.571, -0.096, -0.453, -0.210, 0.243, -0.307)),
    Signature("spring", 0.17, (0.098, 0.190, -0.174, -0.218, -0.175, -0.099, -0.914)),
    Signature("turns", 0.08, (0.722, 0.637, 0.064, -0.246, 0.059, -0.002, 0.065)),
    Signature("gain", 0.13, (-0.037, -0.796, -0.103, 0.036, 0.090, -0.273, -0.520)),
    Signature("friction", 0.23, (0.052, -0.273, 0.313, 0.255, 0.219, 0.813, -0.224)),
    Signature("friction", 0.12, (-0.050, -0.182, 0.154, 0.149, 0.127, 0.928, 0.204)),
    Signature("friction", 0.20, (0.376, 0.112, 0.070, -0.293, -0.258, 0.469, -0.685)),
)


def direction(entries: Sequence[float]) -> tuple[float, ...]:
    """A signature of length 1."""
    length = math.sqrt(total(x * x for x in entries))
    return tuple(x / length for x in entries)
