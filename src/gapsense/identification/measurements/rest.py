"""What a measured voltage and current are at rest, where they should be zero: the offsets of the instruments."""

from __future__ import annotations

import numpy as np

from gapsense.identification.measurements.operations import at_rest, hidden, noise, resolution
from gapsense.identification.measurements.record import Offset, Record, Vector

MOST = 0.1  # of the largest value: more is no offset but a record that does not begin at rest
SIGNIFICANT = 4.0  # standard errors
LOWER = 2e-3  # of the range of the current: no more is as low
HALF = 0.75  # steps of a converter: half of one is the most that it hides
LEVELS = 16  # values of a signal, from which their smallest difference is a step of a converter
CUT, FEW = 0.25, 4  # part of the samples at rest that are the smallest one, and how many are no chance
ONE_WAY = 5.0  # times the largest positive current, from which a negative one is the current of the coil
FEWEST = 8  # samples at rest that tell an offset


def without_offsets(record: Record) -> Record:
    """The record less what voltage and current are before its first operation, as far as that is no chance."""
    n = at_rest(record)
    if n < FEWEST or n == record.times.size:
        return record
    signals = {"voltage": record.voltage, "current": record.current}
    found = {name: offset(x, n) for name, x in signals.items()}
    if any(abs(o.value) > MOST * np.abs(signals[name]).max() for name, o in found.items()) or flows(record, n):
        return record
    told = {name: o for name, o in found.items() if abs(o.value) > _chance(signals[name], n, o)}
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


def _chance(x: Vector, n: int, found: Offset) -> float:
    """The largest offset that may be none."""
    return SIGNIFICANT * found.error if np.ptp(x[:n]) else HALF * resolution(x)


def remaining(record: Record) -> dict[str, float]:
    """Standard error of the offset that voltage and current may still have: of what was subtracted, or is hidden."""
    n, errors = at_rest(record), {name: o.error for name, o in record.offsets.items()}
    for name in ("voltage", "current"):
        x = getattr(record, name)
        if name not in errors and n >= FEWEST and not np.ptp(x[:n]) and np.unique(x).size > LEVELS:
            errors[name] = hidden(x)
    return errors


def unipolar(record: Record) -> tuple[str, ...]:
    """Sentences on signals whose noise ends at their smallest value, as behind a converter that knows no sign."""
    n = at_rest(record)
    signals = {"voltage": record.voltage, "current": record.current}
    return tuple(
        f"`{name}` never falls below {x.min():.4g} at rest, though it is noisy: its converter seems to cut what is "
        "below, so that small values are too large. Shift its range."
        for name, x in signals.items()
        if n >= FEWEST and _is_cut(x[:n], resolution(x))
    )


def _is_cut(x: Vector, step: float) -> bool:
    """Whether a signal rises from its smallest value by more than steps of a converter, and falls back on it often."""
    lowest = np.flatnonzero(x == x.min())
    return bool(lowest.size > max(CUT * x.size, FEW) and np.ptp(x[: lowest[-1] + 1]) > 2.5 * step)


def upright(record: Record) -> Record:
    """The record with its current the right way round: a coil knows no sign, but what is sought in records does."""
    i = record.current
    if -i.min() < ONE_WAY * max(float(i.max()), 0.0) or i.min() >= 0.0 or float(record.voltage @ i) <= 0.0:
        return record
    said = "voltage and current are negative; the signs of both are changed."
    turned = record._replace(voltage=-record.voltage, current=-i, halves=-record.halves)
    return turned._replace(remarks=(*record.remarks, said))
