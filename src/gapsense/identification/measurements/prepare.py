"""Records made ready: offsets taken out, signs turned, long records made shorter.

The mean current of a block stands at its middle, and the voltage between two middles is the mean of what was between
them. So charge and volt-seconds are kept, and noise beyond the new rate does not fold down.
"""

from __future__ import annotations

import numpy as np

from gapsense.identification.measurements.operations import activities, at_rest, operations
from gapsense.identification.measurements.record import Offset, Record, Vector, part
from gapsense.identification.measurements.signals import hidden, noise, resolution

MOST_OFFSET = 0.1  # of the largest value: more is no offset but a record that does not begin at rest
SIGNIFICANT = 4.0  # standard errors
LOWER = 2e-3  # of the range of the current: no more is as low
HALF = 0.75  # steps of a converter; it hides half a step at most
LEVELS = 16  # values of a signal, from which their smallest difference is a step of a converter
CUT, FEW = 0.25, 4  # part of the samples at rest that are the smallest one, and how many are no chance
ONE_WAY = 5.0  # times the largest positive current, from which a negative one is the current of the coil
ON = 0.5  # of the largest voltage: more is held
COARSEST = 0.02  # step of a converter relative to the range; what is coarser are levels of the drive
FEWEST_AT_REST = 8  # samples at rest that tell an offset


def subtract_offsets(record: Record) -> Record:
    """The record less what voltage and current are before its first operation, as far as that is no chance."""
    n = at_rest(record)
    if n < FEWEST_AT_REST or n == record.times.size:
        return record
    found = {name: (x, offset(x, n)) for name, x in record.signals.items()}
    if any(abs(o.value) > MOST_OFFSET * np.abs(x).max() for x, o in found.values()) or flows(record, n):
        return record
    chance = {name: SIGNIFICANT * o.error if np.ptp(x[:n]) else HALF * resolution(x) for name, (x, o) in found.items()}
    told = {name: o for name, (_, o) in found.items() if abs(o.value) > chance[name]}
    v, i = (told[name].value if name in told else 0.0 for name in ("voltage", "current"))
    return record._replace(
        voltage=record.voltage - v, current=record.current - i, halves=record.halves - v, offsets=told
    )


def flows(record: Record, n: int) -> bool:
    """Whether a current flows in the first `n` samples: later it rests lower, though it never becomes negative."""
    i, least = record.current, max(SIGNIFICANT * noise(record.current) / np.sqrt(n), LOWER * np.ptp(record.current))
    sums = np.concatenate(([0.0], np.cumsum(i)))
    lowest = float((sums[n:] - sums[:-n]).min()) / n
    return bool(lowest > -least and lowest < i[:n].mean() - 2.0 * least)


def offset(x: Vector, n: int) -> Offset:
    """Mean of the first `n` samples, and its standard error: that of equal samples is what the converter hides."""
    lost = 0.0 if np.ptp(x[:n]) else hidden(x)
    return Offset(float(x[:n].mean()), float(max(x[:n].std() / np.sqrt(n), noise(x) / np.sqrt(n), lost)))


def remaining(record: Record) -> dict[str, float]:
    """Standard error of the offset that voltage and current may still have: of what was subtracted, or is hidden."""
    n, errors = at_rest(record), {name: o.error for name, o in record.offsets.items()}
    for name, x in record.signals.items():
        if name not in errors and n >= FEWEST_AT_REST and not np.ptp(x[:n]) and np.unique(x).size > LEVELS:
            errors[name] = hidden(x)
    return errors


def hidden_level(v: Vector, i: Vector) -> float:
    """Standard error of a voltage that is held, relative to it, by what a converter hides; noise of a step tells all.

    Noise that reaches but one other step tells nothing.  Of a voltage that shows none of its steps these are taken for
    those of the current.
    """
    on = np.sort(v[v > ON * v.max()])
    held = on[np.abs(on - on[on.size // 2]) < COARSEST * np.ptp(v)]  # a median may lie between two levels
    step = resolution(v) if np.ptp(held) else resolution(i) * float(np.ptp(v) / np.ptp(i))
    if not step < COARSEST * np.ptp(v):
        return 0.0
    spread = held.std() if np.unique(held).size > 2 else 0.0
    return float(step / np.sqrt(12.0) * np.exp(-2.0 * (np.pi * spread / step) ** 2) / np.mean(held))


def unipolar(record: Record) -> tuple[str, ...]:
    """Sentences on signals whose noise ends at their smallest value, as behind a converter that knows no sign."""
    n = at_rest(record)
    return tuple(
        f"`{name}` never falls below {x.min():.4g} at rest, though it is noisy: its converter seems to cut what is "
        "below, so that small values are too large. Shift its range."
        for name, x in record.signals.items()
        if n >= FEWEST_AT_REST and _is_cut(x[:n], resolution(x))
    )


def _is_cut(x: Vector, step: float) -> bool:
    """Whether a signal rises from its smallest value by more than steps of a converter, and falls back on it often."""
    lowest = np.flatnonzero(x == x.min())
    return bool(lowest.size > max(CUT * x.size, FEW) and np.ptp(x[: lowest[-1] + 1]) > 2.5 * step)


def turn_upright(record: Record) -> Record:
    """The record with its current the right way round: a coil knows no sign, but what is sought in records does."""
    i = record.current
    if -i.min() < ONE_WAY * max(float(i.max()), 0.0) or i.min() >= 0.0 or float(record.voltage @ i) <= 0.0:
        return record
    said = "voltage and current are negative; the signs of both are changed."
    slow = record.slow and record.slow.reversed
    turned = record._replace(voltage=-record.voltage, current=-i, halves=-record.halves, slow=slow)
    return turned._replace(remarks=(*record.remarks, said))


LONG = 20_000  # samples; shorter records stay as they are
RISE = 50  # samples in which the current rises to half of its peak: more add no information
SOUND = 0.25  # of the largest current: activities with less do not count
MOST_SAMPLES = 60_000  # samples to which others than whole operations are cut


def thin(record: Record) -> Record:
    """The record, if it is long with as many samples as a fit needs; a remark says so."""
    n = record.times.size
    i, size = np.abs(record.current), 1
    if n > LONG:  # the current rises to half of its peak within so many samples, where it does so fastest
        flows = [i[begin:end] for begin, end in activities(record)]
        rises = [int(np.argmax(x > 0.5 * x.max())) for x in flows if x.max() > SOUND * i.max()]
        size = min(min(rises, default=i.size) // RISE, n // (LONG // 4))
    if size < 2:
        return record
    made = average_blocks(record, size)
    said = (
        f"{n} samples are averaged {size} by {size} to {made.times.size}, one every {1e6 * made.dt:.4g} us,"
        f" at least {RISE} in the rise of the current; more would not improve the result. Charge and volt-seconds"
        " are kept."
    )
    return made._replace(remarks=(*made.remarks, said))


def shorten(record: Record, period: float | None = None) -> Record:
    """The record up to the end of as many operations as a fit can take; a remark says so."""
    if record.times.size <= MOST_SAMPLES:
        return record
    found = operations(record, period)
    kept = [operation for operation in found if operation.stop < MOST_SAMPLES] or found[:1]
    if len(kept) == len(found):
        return record
    said = f"the first {len(kept)} of {len(found)} operations are used: all of them would take long and add little."
    return part(record, slice(0, kept[-1].stop + 1))._replace(remarks=(*record.remarks, said))


def average_blocks(record: Record, size: int) -> Record:
    """Means of blocks of so many samples; what is left over at the end is left out."""
    count = record.times.size // size
    blocks, middles = slice(0, count * size), np.arange(count) * size + size // 2
    places: Vector = np.arange(count, dtype=np.float64) * size + 0.5 * (size - 1)  # in samples
    volts = _average_halves(record, places, size)

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
        are_edges_seen=False,
        slow=None,
        is_filtered=False,
    )


def _average_halves(record: Record, places: Vector, size: int) -> Vector:
    """Average over both halves of the interval before each place; before the record the voltage is as at its start."""
    ends = np.arange(record.times.size)
    passed = np.concatenate(([0.0], np.cumsum(record.applied[1:])))  # volt-samples at each sample
    edges = np.stack((places - size, places - 0.5 * size, places), axis=1)
    at = np.interp(edges, ends, passed) + np.minimum(edges, 0.0) * record.voltage[0]
    return np.asarray(np.diff(at, axis=1) / (0.5 * size))
