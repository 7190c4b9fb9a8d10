"""Resistance of each operation of a record, and the flux linkage: [UKF] (19)-(23).

The flux linkage is not measured but integrated, (21), and what is lost at the start is lost for good: periodicity gives
the resistance (23), never the offset.  So a record must begin at rest, without current, and the integral begins with
its first operation.  With the resistance of (23) for each operation the integral ends where it began, so that no error
is carried from one operation to the next.

The sums as printed are biased by half a sample: the voltage is that of the interval, the current its trapezoid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.operations import Operation, operations
from gapsense.identification.measurements.record import Record, Vector


class Flux(NamedTuple):
    """Resistance and flux linkage of a record, from the start of its first operation on."""

    operations: list[Operation]  # complete ones
    resistances: Vector  # of each [Ohm], (23)
    per_sample: Vector  # resistance of the interval before each sample [Ohm]
    flux_linkage: Vector  # at each sample [Wb]; zero before the first operation


def trapezoid(current: Vector) -> Vector:
    """Mean current over the interval before each sample [A]; the first has no interval."""
    return np.concatenate((current[:1], 0.5 * (current[1:] + current[:-1])))


def estimate(record: Record, found: list[Operation]) -> Flux:
    """Flux linkage by (21), with the resistance of every operation by (23): it ends where it began."""
    means, applied = trapezoid(record.current), record.applied
    resistances = np.array([applied[o.inside].sum() / means[o.inside].sum() for o in found])
    per_sample = np.full(record.times.size, resistances[-1])
    per_sample[: found[0].start + 1] = resistances[0]
    for operation, R in zip(found, resistances):
        per_sample[operation.inside] = R
    rates = applied - per_sample * means
    rates[: found[0].start + 1] = 0.0
    return Flux(found, resistances, per_sample, record.dt * np.cumsum(rates))


def mean_resistance(*records: Record) -> float:
    """Mean resistance by (23) of all operations of some records [Ohm]."""
    return float(np.mean(np.concatenate([estimate(record, operations(record)).resistances for record in records])))


def coil(record: Record, operation: Operation) -> tuple[float, float]:
    """Inductance of the coil of constant L and R that is nearest to an operation, and how far it is from that.

    The integral of v = R i + L di/dt, by least squares: unlike (23) it does not hang on the end of the operation.
    """
    i, means = record.current[operation.inside], trapezoid(record.current[operation.start : operation.stop + 1])[1:]
    charge, volts = (np.cumsum(x) * record.dt for x in (means, record.halves[operation.inside].mean(axis=1)))
    both = np.stack((charge, i), axis=1)
    found = np.linalg.lstsq(both, volts, rcond=None)[0]
    L = float(found[1])
    largest = float(np.abs(L * i).max())
    return L, float(np.sqrt(np.mean((volts - both @ found) ** 2))) / largest if largest else 0.0
