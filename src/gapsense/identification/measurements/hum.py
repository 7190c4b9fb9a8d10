"""Hum of the mains in a recorded current, as it shows at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.operations import MANY, activities, leaves, starts
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import hidden, noise, true_runs
from gapsense.report.table import quantity

MAINS = (50.0, 60.0)  # Hz
SETTLING = 4  # part of a hold, as 1 over it, in which the current settles
CHANCE, MOST = 40.0, 0.6  # squares over the noise's that hum must explain; its part of those that noise does not


class Hum(NamedTuple):
    """What of the current at rest, or while the coil is held, goes with the mains."""

    frequency: float  # [Hz]
    amplitude: float  # [A]

    @property
    def told(self) -> str:
        """How much there is."""
        return f"{quantity(self.amplitude, 'A')} of the steady current goes with {self.frequency:g} Hz"


def hum(record: Record) -> Hum | None:
    """Hum, if it explains most of what the current does at rest: before, and in the later half of pauses.

    Where the coil hardly rests, what the current does while it is held tells it too.
    """
    i, off = record.current, np.abs(record.voltage) < leaves(record.voltage, "voltage")
    ended = [0, *(end for _, end in activities(record))]
    pauses = zip(ended, [*starts(record), i.size])
    rests = [np.arange((a + b) // 2 if a else 0, b) for a, b in pauses]
    at = np.concatenate([x[off[x]] for x in rests if x.size >= MANY] or [np.zeros(0, dtype=int)])
    period = 1.0 / (min(MAINS) * record.dt)
    pieces, curved = [at], []
    if at.size < 2 * MANY or at[-1] - at[0] < period:
        held = [
            np.arange(a + (b - a) // SETTLING, b) for a, b in true_runs(record.voltage > 0.5 * record.voltage.max())
        ]
        curved = [x for x in held if x.size >= max(period, 2.0 * MANY)]
        pieces = [x for x in (at, *curved) if x.size]
        if not curved:
            return None
    at = np.concatenate(pieces)
    own = [np.isin(at, piece).astype(float) for piece in pieces]  # each has a level of its own, the held ones a bend
    t, bends = at * record.dt, [np.isin(at, piece) * (at * record.dt) ** 2 for piece in curved]
    x, sigma = i[at], max(noise(i), hidden(i))

    def fit(*columns: Vector) -> tuple[float, Vector]:
        matrix = np.stack((*columns, *own), axis=1)
        found = np.linalg.lstsq(matrix, x, rcond=None)[0]
        return float(((x - matrix @ found) ** 2).sum()), found

    waves = {f: 2.0 * np.pi * f * t for f in MAINS}
    fits = {f: fit(np.sin(phase), np.cos(phase)) for f, phase in waves.items()}
    left = min(left for left, _ in fits.values())
    alike = {f: float(np.hypot(*found[:2])) for f, (least, found) in fits.items() if least <= left + CHANCE * sigma**2}
    f = min(alike, key=lambda f: alike[f])  # one that is nearly in step with the operations has a large amplitude
    steady, moving = fit()[0], fit(*(one * t for one in own), *bends)[0]
    enough = max(CHANCE * sigma**2, MOST * (steady - at.size * sigma**2), steady - moving)
    return Hum(f, alike[f]) if steady - left > enough else None
