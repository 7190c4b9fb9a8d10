"""How late the current is seen behind the voltage: both begin at once in a coil."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.operations import Operation, noise
from gapsense.identification.measurements.record import Record

LOWEST, HIGHEST = 0.02, 0.5  # of the largest current, between which its beginning is extrapolated
FEWEST = 5  # samples of it
ROUNDED = 0.1  # samples, that the fit leaves at least
OPERATIONS = 20  # that are looked at


class Lag(NamedTuple):
    """Of the current behind the voltage."""

    samples: float
    error: float  # standard error [samples]


def lag(record: Record, found: Sequence[Operation]) -> Lag | None:
    """Mean of the first operations; where the edge lies between two samples, half a sample, is not in its error."""
    sigma = noise(record.current)
    each = [x for x in (one(record, operation, sigma) for operation in found[:OPERATIONS]) if x is not None]
    if not each:
        return None
    late, errors = (np.array(column) for column in zip(*each))
    return Lag(float(late.mean()), float(max(late.std(), errors.mean()) / np.sqrt(late.size)))


def one(record: Record, operation: Operation, sigma: float) -> Lag | None:
    """Of one operation: from half-way to the first sample at its voltage to where its current, extrapolated, begins."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    low = LOWEST * i.max() + 2.0 * sigma
    first, last = (int(np.argmax(i > level)) for level in (low, HIGHEST * i.max()))
    edge = int(np.argmax(v > 0.5 * v.max()))
    if last - first < FEWEST or edge >= last or v[max(first, edge) : last].min() < 0.5 * v.max():
        return None
    k = np.arange(first, last)
    shape, covariance = np.polyfit(i[first:last], k, 2, cov="unscaled")
    left = float(np.std(k - np.polyval(shape, i[first:last]))) + ROUNDED
    return Lag(float(shape[2]) - (edge - 0.5), left * float(np.sqrt(covariance[2, 2])))
