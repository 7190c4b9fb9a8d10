"""Long records made shorter: means of whole blocks, then whole operations only.

A block's mean of the current stands at its middle, and the voltage between two middles is the mean of what was between
them, so that charge and volt-seconds are kept, and noise beyond the new rate does not fold down.
"""

from __future__ import annotations

import numpy as np

from gapsense.identification.measurements.operations import activities, operations
from gapsense.identification.measurements.record import Record, Vector

LONG = 20_000  # samples; shorter records stay as they are
RISE = 50  # samples in which the current rises to half of its peak: more add no information
SOUND = 0.25  # of the largest current: activities with less do not count
MOST = 60_000  # samples to which others than whole operations are cut


def thinned(record: Record) -> Record:
    """The record, if it is long with as many samples as a fit needs; a remark says so."""
    n = record.times.size
    size = min(_rise(record) // RISE, n // (LONG // 4)) if n > LONG else 1
    if size < 2:
        return record
    made = averaged(record, size)
    said = (
        f"{n} samples are averaged {size} by {size} to {made.times.size}, one every {1e6 * made.dt:.4g} us: that are"
        f" at least {RISE} in the rise of the current, more would not make the result better. Charge and volt-seconds"
        " are kept."
    )
    return made._replace(remarks=(*made.remarks, said))


def shortened(record: Record, period: float | None = None) -> Record:
    """The record up to the end of as many operations as a fit can take; a remark says so."""
    if record.times.size <= MOST:
        return record
    found = operations(record, period)
    kept = [operation for operation in found if operation.stop < MOST] or found[:1]
    if len(kept) == len(found):
        return record
    said = (
        f"the first {len(kept)} of {len(found)} operations are used: all of them would take long and tell little more."
    )
    return part(record, slice(0, kept[-1].stop + 1))._replace(remarks=(*record.remarks, said))


def _rise(record: Record) -> int:
    """Samples in which the current rises to half of its peak, where it does so fastest."""
    i = np.abs(record.current)
    flows = [i[begin:end] for begin, end in activities(record)]
    rises = [int(np.argmax(x > 0.5 * x.max())) for x in flows if x.max() > SOUND * i.max()]
    return max(1, min(rises, default=i.size))


def averaged(record: Record, size: int) -> Record:
    """Means of blocks of so many samples; what is left over at the end is left out."""
    count = record.times.size // size
    blocks, middles = slice(0, count * size), np.arange(count) * size + size // 2
    places: Vector = np.arange(count, dtype=np.float64) * size + 0.5 * (size - 1)  # in samples
    volts = _between(record, places, size)

    def means(x: Vector) -> Vector:
        return np.asarray(x[blocks].reshape(count, size).mean(axis=1))

    return record._replace(
        times=record.times[0] + places * record.dt,
        voltage=np.asarray(volts.mean(axis=1)),
        current=means(record.current),
        halves=volts,
        position=None if record.position is None else means(record.position),
        mode=None if record.mode is None else record.mode[middles],
        rows=record.rows[middles],
        is_mean=True,
    )


def _between(record: Record, places: Vector, size: int) -> Vector:
    """Mean voltages of the two halves of the interval before each place; before the record it was as at its start."""
    ends = np.arange(record.times.size)
    passed = np.concatenate(([0.0], np.cumsum(record.applied[1:])))  # volt-samples at each sample
    edges = np.stack((places - size, places - 0.5 * size, places), axis=1)
    at = np.interp(edges, ends, passed) + np.minimum(edges, 0.0) * record.voltage[0]
    return np.asarray(np.diff(at, axis=1) / (0.5 * size))


def part(record: Record, at: slice) -> Record:
    """Some samples of a record."""
    position, mode = (None if x is None else x[at] for x in (record.position, record.mode))
    return record._replace(
        times=record.times[at],
        voltage=record.voltage[at],
        current=record.current[at],
        halves=record.halves[at],
        position=position,
        mode=mode,
        rows=record.rows[at],
    )
