"""What the voltage of a record does: PWM, a supply that sags, the path in which the current falls, filtered edges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.operations import Operation, Places, noise
from gapsense.identification.measurements.record import Record, Vector

SWITCHED = 0.1  # of the range of the voltage, that it rises at once where it is switched
OFTEN = 5  # times that the voltage rises in an operation that is switched
OFF = 0.05  # of the largest voltage: no more is on
FLOWS = 0.1  # of the largest current
CLEAR = 0.8  # part of the variance that a sagging supply explains
SAG = 0.01  # of the voltage: less is none
FEW = 4  # values of a command
EDGES = 200  # of a record that are looked at
STEEP = 0.05  # of the range: a change of the voltage from one sample to the next that belongs to an edge


class Carrier(NamedTuple):
    """PWM, or a chopped current."""

    samples: float  # from one rise of the voltage to the next
    spread: float  # deviation of that
    duty: float  # mean part of a period in which the voltage is on


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


def rises(v: Vector, least: float) -> Places:
    """Samples before which the voltage rises by more than that at once."""
    places = np.flatnonzero(np.diff(v) > least)
    return np.asarray(places[np.diff(places, prepend=-2) > 1] + 1)


def carrier(record: Record, found: Sequence[Operation]) -> Carrier | None:
    """How often the voltage is switched within an operation, if it is."""
    least = max(SWITCHED * float(np.ptp(record.voltage)), 6.0 * noise(record.voltage))
    for operation in found[:EDGES]:
        v = record.voltage[operation.inside]
        places = rises(v, least)
        if places.size >= OFTEN:
            steps = np.diff(places)
            usual = steps[steps < 3.0 * np.median(steps)]
            middle = 0.5 * float(np.median(v[places]) + np.median(v[places - 1]))
            on = v[places[0] : places[-1]] > middle
            return Carrier(float(usual.mean()), float(usual.std()), float(on.mean()))
    return None


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
    limit = max(STEEP * float(np.ptp(v)), 6.0 * noise(v))
    steps = np.diff(v)
    places = np.flatnonzero(np.abs(steps) > limit)[: 20 * EDGES]
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    lengths = [run.size for run in runs[:EDGES] if abs(float(steps[run].sum())) > 0.5 * np.ptp(v)]
    return float(np.median(lengths)) if lengths else 1.0
