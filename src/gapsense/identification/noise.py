"""Noise of the voltage and the current of records, for the estimators that are to use such signals.

Slow noise shows at rest only, and what a converter hides shows nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapsense.identification.measurements.operations import hidden, noise, resolution, starts
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.residual import REST, noise_of

LEAST = 1e-3  # of the largest value: with less, an estimator takes what its model leaves for a fault
COARSEST = 0.02  # step of a converter relative to the range; what is coarser are levels of the drive


def noises(records: Sequence[Record]) -> dict[str, float]:
    """The largest noise of some records, by the parameters of estimators; three digits are more than it is known to."""
    firsts = [next(iter(starts(record)), 0) for record in records]
    found = {
        "noise.voltage": max(_voltage(record, first) for record, first in zip(records, firsts)),
        "noise.current": max(_least(noise_of(r, first), r.current) for r, first in zip(records, firsts)),
    }
    return {name: float(f"{value:.3g}") for name, value in found.items()}


def _voltage(record: Record, first: int) -> float:
    """That of the voltage: at rest if there is any, for a drive that switches often has jumps everywhere."""
    v = record.voltage
    return _least(max(rounding(v), float(v[:first].std()) if first >= REST else noise(v)), v)


def rounding(x: Vector) -> float:
    """What the steps of a converter hide of a signal that may also have the few levels of a drive."""
    return hidden(x) if resolution(x) < COARSEST * np.ptp(x) else 0.0


def _least(found: float, x: Vector) -> float:
    return max(found, LEAST * float(np.abs(x).max()))
