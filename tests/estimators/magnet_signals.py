"""Signals of the pot magnet, with every transition of its automaton."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from c_code import driven, switched
from magnets import POT_MAGNET, POT_MAGNET_PRINTED
from table_i import defaults

from gapsense.actuators import pot_magnet
from gapsense.estimators import hybrid_ekf

T_S, SHOWN = 1e-4, ("current", "position", "velocity", "mode")
PLANTS = {"consistent": POT_MAGNET, "printed": POT_MAGNET_PRINTED}
PULSES = {  # (duration, voltage) and the transitions that they cause in the consistent orientation
    "cycle": (((0.05, 24.0), (0.05, 0.0)), [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]),
    "failed lift": (((0.003, 24.0), (0.03, 0.0)), [(0, 1), (1, 0)]),
    "voltage back": (((0.05, 24.0), (0.005, 0.0), (0.03, 24.0)), [(0, 1), (1, 2), (2, 3), (3, 2)]),
    "pulled back": (((0.05, 24.0), (0.0171, 0.0), (0.03, 24.0)), [(0, 1), (1, 2), (2, 3), (3, 4), (4, 3), (3, 2)]),
    "energised again": (((0.05, 24.0), (0.021, 0.0), (0.05, 60.0)), [(0, 1), (1, 2), (2, 3), (3, 4), (4, 1), (1, 2)]),
}


class Signals(NamedTuple):
    """Samples at multiples of `T_S`; a voltage is held until the next sample."""

    voltage: np.ndarray
    states: np.ndarray  # (n, 4): i, s, v, q


@cache
def magnet(pulses: str = "cycle", orientation: str = "consistent") -> Signals:
    """The plant during pulses of the voltage, from rest."""
    held = [0.0] * 5 + [u for duration, u in PULSES[pulses][0] for _ in range(round(duration / T_S))]
    voltage = np.array(held)
    return Signals(voltage, driven(pot_magnet, PLANTS[orientation], voltage, T_S, *SHOWN))


def faulty(first: int, last: int, halves: int, half: int, **changes: float) -> Signals:
    """A square wave of 24 V, with another magnet in some of its halves."""
    devices, count = (POT_MAGNET, POT_MAGNET._replace(**changes)), np.arange(halves * half) // half
    voltage, is_other = np.where(count % 2 == 0, 24.0, 0.0), (first <= count) & (count < last)
    return Signals(voltage, switched(pot_magnet, devices, 1 * is_other, voltage, T_S, *SHOWN))


def exact(orientation: str = "consistent", **changes: float) -> Any:
    """Parameters of the filter that are those of the plant."""
    names = set(hybrid_ekf.Parameters._fields)
    known = {name: value for name, value in PLANTS[orientation]._asdict().items() if name in names}
    return defaults(hybrid_ekf, **{**known, **changes})


def changes_of(modes: np.ndarray) -> list[tuple[int, int]]:
    """Transitions of a sequence of modes."""
    return [(int(a), int(b)) for a, b in pairwise(modes) if a != b]
