"""Signatures of causes: which way innovations and learnt values go.

`SUDDEN` are mean innovations of the first closing (before the motion, in it, after the landing, in the rest) and of
the first opening with a fault.  `GRADUAL` are learnt values (eddy currents, gap factor, knee, saturation, hysteresis,
mass, rest position) in usual wanderings.  Only the direction counts.  The scenario `condition` has found them.
"""

from __future__ import annotations

import math

Signature = tuple[float, ...]

SUDDEN: dict[str, Signature] = {
    "stuck_upper": (0.4, 25.9, 3.7, 0.0, 14.4, -30.6, -8.5, -0.2),
    "stuck_lower": (-87.6, 24.6, 4.7, 0.3, 0.2, -11.1, 2.8, 2.4),
    "lower_stop": (0.4, 3.6, 4.0, -1.2, 25.0, -12.4, -6.8, -0.1),
    "upper_stop": (-21.9, -4.2, 7.2, -0.8, 0.2, -0.6, -0.1, 0.2),
    "spring": (0.4, -10.5, 6.1, -0.8, -0.3, -8.3, 4.9, 0.9),
    "turns": (31.8, 29.8, 30.0, 30.2, -1.3, -0.9, -0.4, 0.0),
    "contact": (-7.0, -32.8, -60.7, -52.7, -14.3, -5.3, -1.8, -0.1),
    "open": (-200.0, -350.0, -400.0, -600.0, -100.0, -30.0, -10.0, 0.0),
    "supply": (-47.0, -89.5, -145.4, -117.6, -14.0, -1.5, -0.5, 0.0),
    "gain": (-23.1, -50.7, -58.4, -59.1, -18.8, -5.6, -0.2, 0.0),
    "friction": (0.4, 11.4, -9.2, -0.5, 0.3, -4.2, 3.8, 0.1),
}
GRADUAL: dict[str, Signature] = {
    "lower_stop": (4.3, 50.7, -6.0, -43.6, -167.7, 39.4, -60.0),
    "upper_stop": (-1.0, -15.0, -10.0, -15.0, -20.0, -9.4, -15.6),
    "spring": (-2.6, -2.5, -0.6, 2.2, 1.6, -2.4, -22.7),
    "turns": (25.3, 50.8, 3.9, -21.2, 3.4, 0.1, 4.2),
    "supply": (5.2, -79.3, -3.1, 58.9, -15.7, 35.7, 40.4),
    "gain": (-4.7, -54.7, -7.1, 1.8, -0.4, -19.7, -30.8),
    "friction": (-0.6, -16.2, 18.2, 18.1, 12.1, 43.2, -6.6),
}
CAUSES = (*SUDDEN, "still")  # in the order of their numbers, from 1 on
SPREAD_SUDDEN, SPREAD_GRADUAL = 0.1, 0.25  # deviation of an entry of a direction from device to device


def direction(signature: Signature) -> Signature:
    """A signature of length 1."""
    length = math.sqrt(sum(x * x for x in signature))
    return tuple(x / length for x in signature)
