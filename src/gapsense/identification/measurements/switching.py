"""PWM, or a chopped current, in the samples of a voltage: its period, where it is, and how well they tell its mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.operations import Operation, Places
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import ANYWHERE, noise

SWITCHED = 0.1  # rise at a switched edge, in the range of the voltage
OFTEN = 5  # times that the voltage rises in an operation that is switched
FLOWS = 0.05  # of the largest current
NEXT = 3.0  # usual periods after which a rise is no more one of the same pulses


class Carrier(NamedTuple):
    """PWM, or a chopped current."""

    samples: float  # from one rise of the voltage to the next
    spread: float  # deviation of that
    duty: float  # mean part of a period in which the voltage is on
    doubt: float  # standard error of its mean voltage by samples of it [V]
    late: float  # the same of where all its edges lie between two samples, if in step [s]


def rises(v: Vector, least: float = 0.0) -> Places:
    """Samples before which the voltage rises at once, as at a switched edge or by more than that."""
    least = least or max(SWITCHED * float(np.ptp(v)), 6.0 * noise(v))
    places = np.flatnonzero(np.diff(v) > least)
    return np.asarray(places[np.diff(places, prepend=-2) > 1] + 1)


def carrier(record: Record, found: Sequence[Operation], most: int = 200) -> Carrier | None:
    """How often the voltage is switched within an operation of the first ones, if it is."""
    size = float(np.ptp(record.voltage))
    least = max(SWITCHED * size, 6.0 * noise(record.voltage))
    for operation in found[:most]:
        v = record.voltage[operation.inside]
        places = rises(v, least)
        if places.size >= OFTEN:
            steps = np.diff(places)
            usual = steps[steps < NEXT * np.median(steps)]
            middle = 0.5 * float(np.median(v[places]) + np.median(v[places - 1]))
            on = v[places[0] : places[-1]] > middle
            is_alike = np.ptp(usual) == 0.0  # in step the same is lost in every period
            return Carrier(
                samples=float(usual.mean()),
                spread=float(usual.std()),
                duty=float(on.mean()),
                doubt=float(np.sqrt(2.0 / (1.0 if is_alike else usual.size)) * ANYWHERE * size / usual.mean()),
                late=float(ANYWHERE * record.dt * is_alike),
            )
    return None


def is_switched(v: Vector, i: Vector) -> npt.NDArray[np.bool_]:
    """Whether each sample lies between two rises of PWM, from one to the next of which current flows."""
    places, found = rises(v), np.zeros(v.size, dtype=bool)
    flows = np.abs(i) > FLOWS * np.abs(i).max(initial=0.0)
    pulses = [(a, b) for a, b in zip(places[:-1].tolist(), places[1:].tolist()) if flows[a:b].all()]
    for a, b in pulses if len(pulses) >= OFTEN else ():
        found[a:b] = True
    return found
