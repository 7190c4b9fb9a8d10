"""What a record of voltage and current can give, before anything is fitted to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.checks import (
    begins_at_rest,
    clipping,
    operation_problems,
    rest_problems,
    slow_problems,
)
from gapsense.identification.measurements.operations import (
    Operation,
    activities,
    at_rest,
    coil,
    estimate,
    operations,
    starts,
)
from gapsense.identification.measurements.prepare import FEWEST_AT_REST, offset
from gapsense.identification.measurements.record import Columns, Offset, Record, Vector
from gapsense.identification.measurements.signals import average, edges, hidden, noise, resolution
from gapsense.identification.measurements.switching import Carrier, carrier

OFF = 0.05  # of the largest voltage: no more is on
FLOWS = 0.1  # of the largest current
CLEAR = 0.8  # part of the variance that a sagging supply explains
SAG = 0.01  # of the voltage: less does not count
FEW = 4  # values of a command
EDGES = 200  # of a record that are looked at
STEEP = 0.05  # of the range: a change of the voltage from one sample to the next that belongs to an edge


class Path(NamedTuple):
    """How current is driven and falls."""

    carrier: Carrier | None
    source: float | None  # resistance by which the supply sags [Ohm]
    decay: float | None  # voltage while the current falls [V]
    edge: float  # samples that an edge of the voltage takes; 1 for one between two samples
    is_command: bool  # the voltage has a few values and no noise


def path(record: Record, found: Sequence[Operation]) -> Path:
    """All of it, from complete operations or the whole record."""
    parts = list(found) or [Operation(0, record.times.size - 1)]
    first = carrier(record, parts)
    return Path(
        carrier=first,
        source=source(record, parts[0]) if first is None else None,
        decay=decay(record, parts[0]),
        edge=edge(record.voltage),
        is_command=noise(record.voltage) == 0.0 and np.unique(record.voltage[:100000]).size <= FEW,
    )


def source(record: Record, operation: Operation) -> float | None:
    """Resistance by which the voltage falls with the current while it is on [Ohm]."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    on = v > 0.5 * v.max()
    if on.sum() < 20 or np.ptp(i[on]) == 0.0:
        return None
    slope, level = np.polyfit(i[on], v[on], 1)
    left = float(np.var(v[on] - slope * i[on]) / max(np.var(v[on]), 1e-30))
    sags = -slope * np.ptp(i[on]) > SAG * abs(level)
    return float(-slope) if sags and left < 1.0 - CLEAR else None


def decay(record: Record, operation: Operation) -> float | None:
    """Voltage while the current falls, after the last time that it was on [V]."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    last = np.flatnonzero(v > OFF * v.max() + 6.0 * noise(record.voltage))
    after = slice(int(last[-1]) + 2, None) if last.size else slice(0, 0)
    flows = i[after] > FLOWS * i.max()
    return float(np.median(v[after][flows])) if flows.sum() >= 3 else None


def edge(v: Vector) -> float:
    """Samples over which an edge of the voltage goes, the median over the first ones."""
    lengths = [b - a for a, b in edges(v, STEEP)[:EDGES]]
    return float(np.median(lengths)) if lengths else 1.0


LOWEST, HIGHEST = 0.02, 0.5  # of the largest current, between which its beginning is extrapolated
FEWEST_IN_RISE = 5  # samples of it
ROUNDED = 0.1  # samples, that the fit leaves at least
OPERATIONS = 20  # that are looked at


class Lag(NamedTuple):
    """Of the current behind the voltage."""

    samples: float
    error: float  # standard error [samples]
    is_before: float = 0.0  # part of the operations in which current flows before the voltage is on


def lag(record: Record, found: Sequence[Operation]) -> Lag | None:
    """Mean of the first operations; where the edge lies between two samples, half a sample, is not in its error."""
    sigma = noise(record.current)
    each = [x for x in (one(record, operation, sigma) for operation in found[:OPERATIONS]) if x is not None]
    if not each:
        return None
    late, errors, before = (np.array(column) for column in zip(*each))
    error = float(max(late.std(), errors.mean()) / np.sqrt(late.size))
    return Lag(float(late.mean()), error, float(before.mean()))


def one(record: Record, operation: Operation, sigma: float) -> Lag | None:
    """Of one operation: from half-way to the first sample at its voltage to where its current, extrapolated, begins."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    low = LOWEST * i.max() + 2.0 * sigma
    first, last = (int(np.argmax(i > level)) for level in (low, HIGHEST * i.max()))
    edge = int(np.argmax(v > 0.5 * v.max()))
    if last - first < FEWEST_IN_RISE or edge >= last or v[max(first, edge) : last].min() < 0.5 * v.max():
        return None
    k = np.arange(first, last)
    shape, covariance = np.polyfit(i[first:last], k, 2, cov="unscaled")
    left = float(np.std(k - np.polyval(shape, i[first:last]))) + ROUNDED
    is_before = edge > 0 and float(i[edge - 1]) > low
    return Lag(float(shape[2]) - (edge - 0.5), left * float(np.sqrt(covariance[2, 2])), float(is_before))


STEADY = 0.05  # of the largest voltage: a voltage that changes less is held
SIGMAS = 6.0  # times the noise of what is compared
SMOOTHED = (25, 100, 400, 1600)  # parts of a stretch over which the current is averaged, until a motion is seen
LEAST = 1e-3  # of the largest current: a smaller change of its course does not count
GONE = 0.03  # of the largest current: less says nothing
AFTER = 3  # samples after a change of the voltage, in which filters still follow
SHORTEST = 12  # samples of a held voltage
LOW = 0.25  # of the largest voltage: less does not drive
RISEN = 0.9  # a current that begins above this share of where it falls has not risen
MOST = 64  # stretches of an operation that are searched
FINER = 12  # parts of a fall of the current, over which it is averaged to find its end
SCALES = (6, 8, 12, 16, 24, 48)  # parts of a falling current in which it is compared with a straight line


class Kink(NamedTuple):
    """Where the course of the current shows a motion."""

    begin: float  # [s]
    end: float  # where it rises again, or bends most: on closing, the mover lands there [s]
    samples: int  # between them


def closing(record: Record, operation: Operation, sigma: float, carrier: Carrier | None = None) -> Kink | None:
    """Where the current, with noise `sigma`, falls though the voltage is held, or switched by PWM."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    driven = held(v)
    if carrier is not None:
        i, sigma, driven = average_over_carrier(v, i, sigma, carrier)
    for a, b in driven:
        found = fall(i[a:b], sigma, LEAST * float(i.max())) if v[a:b].mean() > LOW * v.max() else None
        if found and i[a] < RISEN * i[a + found[0]]:
            return kink(record, operation, a + found[0], a + found[1])
    return None


def opening(record: Record, operation: Operation, sigma: float) -> Kink | None:
    """Where the falling current, with noise `sigma`, falls faster again."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    for a, b in held(v):
        flows = np.flatnonzero(i[a:b] > GONE * i.max() + 4.0 * sigma)
        b = a + int(flows[-1]) + 1 if flows.size else a
        if b - a < SHORTEST or i[a] <= i[b - 1] or v[a:b].mean() > LOW * v.max():
            continue
        if found := bulge(i[a:b], sigma, LEAST * float(i.max())):
            return kink(record, operation, a + found[0], a + found[1])
    return None


def kink(record: Record, operation: Operation, begin: int, end: int) -> Kink:
    """Between two samples of an operation."""
    times = record.times[operation.start + 1 + begin], record.times[operation.start + 1 + end]
    return Kink(float(times[0]), float(times[1]), end - begin)


def average_over_carrier(
    v: Vector, i: Vector, sigma: float, carrier: Carrier
) -> tuple[Vector, float, list[tuple[int, int]]]:
    """Current over a period of PWM, its noise, that of aliases included, and where the voltage is switched."""
    width, on = max(2, round(carrier.samples)), np.flatnonzero(v > 0.5 * v.max())
    mean = np.convolve(i, np.ones(width) / width, mode="same")
    a, b = int(on[0]) + width, int(on[-1]) - width
    return mean, max(sigma / float(np.sqrt(width)), noise(mean[a:b:width])), [(a, b)] if b - a >= SHORTEST else []


def held(v: Vector) -> list[tuple[int, int]]:
    """Stretches in which the voltage stays what it is, without the samples in which filters still follow a change."""
    limit, found = max(STEADY * float(np.abs(v).max()), SIGMAS * noise(v)), list[tuple[int, int]]()
    jumps = np.flatnonzero(np.abs(np.diff(v)) > limit) + 1
    ends = [0, *jumps.tolist(), v.size]
    long = [(a + AFTER, b) for a, b in zip(ends[:-1], ends[1:]) if b - a >= SHORTEST + AFTER]
    for begin, end in long[:MOST]:
        windows = np.lib.stride_tricks.sliding_window_view(v[begin:end], SHORTEST)
        quiet = np.flatnonzero(windows.max(axis=1) - windows.min(axis=1) < limit)
        if quiet.size:
            a = begin + int(quiet[0])
            left = np.flatnonzero(np.abs(v[a:end] - np.median(v[a : a + SHORTEST])) > limit)
            found.append((a, a + int(left[0]) if left.size else end))
    return found


def fall(i: Vector, sigma: float, least: float) -> tuple[int, int] | None:
    """Where a rising current begins to fall, and where it rises again: a coil may be held for long after that."""
    for parts in SMOOTHED:
        most = SIGMAS * float(np.sqrt(np.log(parts) / np.log(SMOOTHED[0])))  # more parts have larger extremes
        width = max(1, round(i.size / parts))
        smooth = average(i, width)
        falls = np.flatnonzero(np.maximum.accumulate(smooth) - smooth > most * sigma / np.sqrt(width) + least)
        if falls.size:
            begin, after = int(np.argmax(smooth[: falls[0] + 1])), smooth[falls[0] :]
            rises = np.flatnonzero(np.minimum.accumulate(after) < after - least)
            last = int(falls[0]) + (int(rises[0]) if rises.size else after.size - 1) + width
            fine = max(1, (last - begin) // FINER)
            return begin + width // 2, begin + int(np.argmin(average(i[begin:last], fine))) + fine // 2
    return None


def bulge(i: Vector, sigma: float, least: float) -> tuple[int, int] | None:
    """Where a falling current falls more slowly than a straight line to what follows, and where it bends down."""
    found = None
    for part in SCALES:  # the coarsest shows where it begins, the finest that noise allows shows where it ends
        h = i.size // part
        width = max(1, h // 2)
        if h < 2 or i.size <= 2 * h + width:
            continue
        smooth = average(i, width)
        bend = smooth[2 * h :] - 2.0 * smooth[h:-h] + smooth[: -2 * h]
        is_bent = bend < -SIGMAS * sigma * np.sqrt(6.0 / width) - least
        if is_bent.any():
            place = h + width // 2
            found = found[0] if found else int(np.argmax(is_bent)) + place, int(np.argmin(bend)) + place
    return found if found is None else (min(found), max(found))


LEVEL = 0.08  # width of a level of the voltage, relative to its range
SHARE = 0.02  # part of the samples that make a level
WHITE, CHANCE = 0.3, 3.0  # correlation of neighbours from which noise is not white; its standard errors that chance has


class Signal(NamedTuple):
    """Voltage or current as it was measured, in its unit."""

    smallest: float
    largest: float
    noise: float
    step: float  # of the converter; 0 if it is too fine to be seen
    correlation: float  # of the noise of neighbouring samples at rest, 0 if it may be chance; NaN without rest
    offset: Offset | None  # at rest; None without rest


class Pulse(NamedTuple):
    """A complete operation."""

    operation: Operation
    peak: float  # largest current [A]
    resistance: float  # (23) [Ohm]
    flux_linkage: float  # largest (21) [Wb]
    inductance: float  # of the nearest coil of constant inductance [H]
    bend: float  # of the flux linkage from that coil's, RMS, relative to its largest value
    rise: int  # samples in which the current rises to half of its peak
    closing: Kink | None  # where the current falls though the voltage is held: something moves
    opening: Kink | None  # where the falling current falls faster again: it moves back


class Begun(NamedTuple):
    """An operation without an end."""

    operation: Operation  # as far as it goes
    closing: Kink | None


class Facts(NamedTuple):
    """All of it."""

    dt: float  # sampling period [s]
    first: float  # time of the first sample [s]
    rest: int  # samples before the first operation
    signals: Mapping[str, Signal]
    levels: list[float]  # of the voltage [V]
    pulses: list[Pulse]
    begun: list[Begun]  # operations without an end
    path: Path
    lag: Lag | None  # of the current behind the voltage
    clipped: list[str]  # sentences on signals at the limits of their converters
    is_from_rest: bool  # no current flows before the first operation
    slow: list[str]  # why its times cannot be seconds
    unready: list[str]  # why no model can begin with the record
    unfinished: list[str]  # why `identify` finds no operation in it

    @property
    def closings(self) -> list[Begun]:
        """Those of all operations, with an end or without."""
        return [*(Begun(pulse.operation, pulse.closing) for pulse in self.pulses), *self.begun]


def facts(record: Record, period: float | None = None, may_clip: bool = False) -> Facts:
    """Facts of a record that has been read without its offsets."""
    rest, found = at_rest(record), operations(record, period)
    raw = {n: x + (record.offsets[n].value if n in record.offsets else 0.0) for n, x in record.signals.items()}
    measured = Columns(record.name, record.rows, raw)  # with their offsets
    unready = [*rest_problems(record, record.name)]
    switched = path(record, found)
    return Facts(
        dt=record.dt,
        first=float(record.times[0]),
        rest=rest,
        signals={name: signal(x, rest) for name, x in raw.items()},
        levels=levels(record.voltage),
        pulses=pulses(record, found, switched.carrier),
        begun=find_begun(record, found, switched.carrier),
        path=switched,
        lag=lag(record, found),
        clipped=[] if may_clip else [text for name in raw for text in clipping(measured, name)],
        is_from_rest=begins_at_rest(record),
        slow=[*slow_problems(record, record.name)],
        unready=unready,
        unfinished=[] if unready else [*operation_problems(record, record.name, period)],
    )


def find_begun(record: Record, found: list[Operation], switched: Carrier | None) -> list[Begun]:
    """Find operations that do not end, or not as they begin."""
    sigma, ends = max(noise(record.current), hidden(record.current)), [end for _, end in activities(record)]
    last = record.times.size - 1
    left = [Operation(a, min(b, last)) for a, b in zip(starts(record), ends) if not found or a >= found[-1].stop]
    return [Begun(at, closing(record, at, sigma, switched)) for at in left]


def signal(x: Vector, rest: int) -> Signal:
    """A measured signal, of which the first samples are at rest."""
    step, quiet = resolution(x), x[:rest] - x[:rest].mean() if rest >= FEWEST_AT_REST else np.empty(0)
    power = float(quiet @ quiet)
    together = float(quiet[1:] @ quiet[:-1]) / power if power > 0.0 else np.nan
    return Signal(
        smallest=float(x.min()),
        largest=float(x.max()),
        noise=max(noise(x), float(quiet.std()) if quiet.size else 0.0),
        step=step if np.isfinite(step) and step > 1e-5 * np.ptp(x) else 0.0,
        correlation=0.0 if abs(together) < CHANCE / np.sqrt(max(quiet.size, 1)) else together,
        offset=offset(x, rest) if rest >= FEWEST_AT_REST else None,
    )


def levels(voltage: Vector) -> list[float]:
    """Voltages at which the drive stays, from the lowest on: medians of what many samples share."""
    width = LEVEL * float(np.ptp(voltage))
    ordered, found = np.sort(voltage), list[float]()
    cuts = np.flatnonzero(np.diff(ordered) > width / 4.0) + 1
    for group in np.split(ordered, cuts):
        if group.size > SHARE * voltage.size and np.ptp(group) <= width:
            found.append(float(np.median(group)))
    return found


def pulses(record: Record, found: list[Operation], switched: Carrier | None) -> list[Pulse]:
    """Each complete operation."""
    if not found:
        return []
    flux, made = estimate(record, found), []
    sigma = max(noise(record.current), hidden(record.current))
    for operation, R in zip(found, flux.resistances.tolist()):
        i, lam = record.current[operation.inside], flux.flux_linkage[operation.inside]
        L, bend = coil(record, operation)
        made.append(
            Pulse(
                operation=operation,
                peak=float(i.max()),
                resistance=R,
                flux_linkage=float(lam.max()),
                inductance=L,
                bend=bend,
                rise=int(np.argmax(i > 0.5 * i.max())),
                closing=closing(record, operation, sigma, switched),
                opening=opening(record, operation, sigma),
            )
        )
    return made
