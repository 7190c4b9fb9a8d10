"""What a record of voltage and current can give, before anything is fitted to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gapsense.studies.identification.flux import coil, estimate
from gapsense.studies.identification.operations import Operation, activities, at_rest, noise, operations, resolution
from gapsense.studies.identification.record import Offset, Record, Vector
from gapsense.studies.identification.rest import FEWEST, offset

STEADY = 0.05  # of the largest voltage: a voltage that changes less is held
DIP = 6.0  # times the noise of the smoothed current: a current that falls by more while the voltage is held is a kink
SMOOTHED = 0.04  # part of the rise of the current over which it is averaged
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
    kink: float | None  # [s], where it falls though the voltage is held: something moves


class Facts(NamedTuple):
    """All of it."""

    rest: int  # samples before the first operation
    signals: Mapping[str, Signal]
    levels: list[float]  # of the voltage [V]
    pulses: list[Pulse]
    incomplete: int  # operations without an end


def facts(record: Record, period: float | None = None) -> Facts:
    """Facts of a record that has been read without its offsets."""
    rest = at_rest(record)
    found = operations(record, period)
    raw = {
        name: x + (record.offsets[name].value if name in record.offsets else 0.0)
        for name, x in (("voltage", record.voltage), ("current", record.current))
    }
    return Facts(
        rest=rest,
        signals={name: signal(x, rest) for name, x in raw.items()},
        levels=levels(record.voltage),
        pulses=pulses(record, found),
        incomplete=max(0, len(activities(record)) - len(found)),
    )


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
        if group.size > SHARE * voltage.size and np.ptp(group) < width:
            found.append(float(np.median(group)))
    return found


def pulses(record: Record, found: list[Operation]) -> list[Pulse]:
    """Each complete operation."""
    if not found:
        return []
    flux, made = estimate(record, found), []
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
                kink=kink(record, operation),
            )
        )
    return made


def kink(record: Record, operation: Operation) -> float | None:
    """Time at which the current begins to fall though the voltage is held, as it does when a mover lands."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    begin = int(np.argmax(v > 0.5 * v.max()))
    dropped = np.flatnonzero(np.abs(v[begin + 1 :] - v[begin + 1 : begin + 4].mean()) > STEADY * v.max())
    end = begin + 1 + (int(dropped[0]) if dropped.size else v.size - begin - 1)
    width = max(1, round(SMOOTHED * (end - begin)))
    if end - begin < 4 * width:
        return None
    smooth = np.convolve(i[begin:end], np.ones(width) / width, mode="valid")
    top = np.maximum.accumulate(smooth)
    falls = np.flatnonzero(top - smooth > DIP * noise(record.current) / np.sqrt(width) + resolution(i) / 2.0)
    if not falls.size:
        return None
    at = int(np.argmax(smooth[: falls[0] + 1]))
    return float(record.times[operation.start + 1 + begin + at + width // 2])
