"""Operations of a record, the resistance of each and the flux linkage: [UKF] (19)-(23).

The flux linkage is not measured but integrated, (21), and what is lost at the start is lost for good: periodicity gives
the resistance (23), never the offset.  So a record must begin at rest, without current, and the integral begins with
its first operation.  With the resistance of (23) for each operation the integral ends where it began, so that no error
is carried from one operation to the next.

The sums as printed are biased by half a sample: the voltage is that of the interval, the current its trapezoid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.studies.identification.record import Record, Vector

LOW, HIGH = 0.25, 0.75  # levels between the lowest and the highest voltage that tell an edge from noise


class Operation(NamedTuple):
    """Samples `start` to `stop` of one period; the flux linkage is the same at both."""

    start: int
    stop: int

    @property
    def inside(self) -> slice:
        """The samples whose intervals, those before them, belong to the period."""
        return slice(self.start + 1, self.stop + 1)


class Flux(NamedTuple):
    """Resistance and flux linkage of a record, from the start of its first operation on."""

    operations: list[Operation]  # complete ones
    resistances: Vector  # of each [Ohm], (23)
    per_sample: Vector  # resistance of the interval before each sample [Ohm]
    flux_linkage: Vector  # at each sample [Wb]; zero before the first operation


def edges(voltage: Vector) -> npt.NDArray[np.int_]:
    """Last sample before each rise of the voltage from its low to its high level."""
    low, high = float(voltage.min()), float(voltage.max())
    level = np.where(voltage < low + LOW * (high - low), 0, np.where(voltage > low + HIGH * (high - low), 1, -1))
    known = np.flatnonzero(level >= 0)
    rises = known[1:][(level[known[1:]] == 1) & (level[known[:-1]] == 0)]
    starts = [int(known[np.searchsorted(known, k) - 1]) for k in rises]
    return np.array(([0] if level[0] == 1 else []) + starts, dtype=int)


def operations(record: Record, period: float | None = None) -> list[Operation]:
    """Complete operations: from each rising edge to the next, or every `period` [s] from the first edge on."""
    starts, last = edges(record.voltage).tolist(), record.times.size - 1
    if not starts:
        return []
    if period is not None:
        count = int((last - starts[0]) * record.dt / period + 1e-6)
        starts = np.round(starts[0] + np.arange(count + 1) * (period / record.dt)).astype(int).tolist()
    elif len(starts) > 1 and (end := 2 * starts[-1] - starts[-2]) <= last:
        starts.append(end)  # the last one may end the record
    return [Operation(a, b) for a, b in zip(starts[:-1], starts[1:])]


def trapezoid(current: Vector) -> Vector:
    """Mean current over the interval before each sample [A]; the first has no interval."""
    return np.concatenate((current[:1], 0.5 * (current[1:] + current[:-1])))


def estimate(record: Record, found: list[Operation]) -> Flux:
    """Flux linkage by (21), with the resistance of every operation by (23): it ends where it began."""
    means = trapezoid(record.current)
    resistances = np.array([record.applied[o.inside].sum() / means[o.inside].sum() for o in found])
    per_sample = np.full(record.times.size, resistances[-1])
    per_sample[: found[0].start + 1] = resistances[0]
    for operation, R in zip(found, resistances):
        per_sample[operation.inside] = R
    rates = record.applied - per_sample * means
    rates[: found[0].start + 1] = 0.0
    return Flux(found, resistances, per_sample, record.dt * np.cumsum(rates))
