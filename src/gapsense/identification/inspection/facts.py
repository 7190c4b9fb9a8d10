"""What a record of voltage and current can give, before anything is fitted to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gapsense.identification.inspection.drive import Carrier, Path, path
from gapsense.identification.inspection.kinks import Kink, closing, opening
from gapsense.identification.inspection.lag import Lag, lag
from gapsense.identification.measurements.flux import coil, estimate
from gapsense.identification.measurements.operations import (
    Operation,
    activities,
    at_rest,
    hidden,
    noise,
    operations,
    resolution,
)
from gapsense.identification.measurements.record import Columns, Offset, Record, Vector
from gapsense.identification.measurements.refusals import begins_at_rest, operation_problems, rest_problems
from gapsense.identification.measurements.rest import FEWEST, offset
from gapsense.identification.measurements.samples import clipping

LEVEL = 0.08  # width of a level of the voltage, relative to its range
SHARE = 0.02  # part of the samples that make a level
WHITE = 0.3  # correlation of neighbours from which noise is not white


class Signal(NamedTuple):
    """Voltage or current as it was measured, in its unit."""

    smallest: float
    largest: float
    noise: float
    step: float  # of the converter; 0 if it is too fine to be seen
    correlation: float  # of the noise of neighbouring samples at rest; NaN without rest
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


class Facts(NamedTuple):
    """All of it."""

    dt: float  # sampling period [s]
    first: float  # time of the first sample [s]
    rest: int  # samples before the first operation
    signals: Mapping[str, Signal]
    levels: list[float]  # of the voltage [V]
    pulses: list[Pulse]
    incomplete: int  # operations without an end
    path: Path
    lag: Lag | None  # of the current behind the voltage
    clipped: list[str]  # what is told of signals at the limits of their converters
    is_from_rest: bool  # no current flows before the first operation
    unready: list[str]  # why no model can begin with the record
    unfinished: list[str]  # why `identify` finds no operation in it


def facts(record: Record, period: float | None = None, may_clip: bool = False) -> Facts:
    """Facts of a record that has been read without its offsets."""
    rest, found = at_rest(record), operations(record, period)
    raw = as_measured(record)
    unready = [*rest_problems(record, record.name)]
    switched = path(record, found)
    return Facts(
        dt=record.dt,
        first=float(record.times[0]),
        rest=rest,
        signals={name: signal(x, rest) for name, x in raw.items()},
        levels=levels(record.voltage),
        pulses=pulses(record, found, switched.carrier),
        incomplete=max(0, len(activities(record)) - len(found)),
        path=switched,
        lag=lag(record, found),
        clipped=[] if may_clip else clipped(record, raw),
        is_from_rest=begins_at_rest(record),
        unready=unready,
        unfinished=[] if unready else [*operation_problems(record, record.name, period)],
    )


def as_measured(record: Record) -> dict[str, Vector]:
    """Voltage and current with their offsets."""
    signals = {"voltage": record.voltage, "current": record.current}
    return {name: x + (record.offsets[name].value if name in record.offsets else 0.0) for name, x in signals.items()}


def clipped(record: Record, raw: Mapping[str, Vector]) -> list[str]:
    """What is told of signals at the limits of their converters."""
    columns = Columns(record.name, record.rows, raw)
    return [text for name in raw for text in clipping(columns, name)]


def signal(x: Vector, rest: int) -> Signal:
    """A measured signal, of which the first samples are at rest."""
    step, quiet = resolution(x), x[:rest] - x[:rest].mean() if rest >= FEWEST else np.empty(0)
    power = float(quiet @ quiet)
    return Signal(
        smallest=float(x.min()),
        largest=float(x.max()),
        noise=max(noise(x), float(quiet.std()) if quiet.size else 0.0),
        step=step if np.isfinite(step) and step > 1e-5 * np.ptp(x) else 0.0,
        correlation=float(quiet[1:] @ quiet[:-1]) / power if power > 0.0 else np.nan,
        offset=offset(x, rest) if rest >= FEWEST else None,
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
