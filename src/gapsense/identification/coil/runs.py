"""Records prepared for the fit of a coil: from the first operation on, with what their converters hide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.coil.forms import Scale
from gapsense.identification.measurements.flux import coil, estimate
from gapsense.identification.measurements.operations import noise, operations, resolution
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.residual import FLOOR, REST, noise_of

OWN = 0.3 * FLOOR  # of the largest current: what the sampling leaves of a record without noise
COARSEST = 0.05  # half a step of a converter, of the largest value: more are the levels of a voltage that is commanded
SIGNALS = ("voltage", "current")


class Run(NamedTuple):
    """One record from its first operation on."""

    record: Record
    first: int  # the last sample at rest
    current: Vector  # measured [A]
    voltages: Vector  # what drives the coil (n, 3) [V]
    noise: float  # of the current [A]
    hidden: tuple[float, float]  # largest offset of voltage [V] and current [A] that the rest does not show


def run(record: Record, period: float | None = None) -> Run:
    """A record prepared."""
    first = operations(record, period)[0].start
    i = record.current[first:]
    sigma = max(noise_of(record, first), OWN * float(np.abs(i).max()))
    voltage, current = (hidden(getattr(record, name), first) for name in SIGNALS)
    return Run(
        record=record, first=first, current=i, voltages=driving(record, first), noise=sigma, hidden=(voltage, current)
    )


def driving(record: Record, first: int) -> Vector:
    """Inputs of the coil from a sample on (n, 3) [V]."""
    return np.concatenate((record.halves[first:], record.voltage[first:, None]), axis=1)


def hidden(x: Vector, first: int) -> float:
    """Half a step of a converter whose noise at rest is less: the mean at rest then says little of other values."""
    step = resolution(x)
    spread = float(x[:first].std()) if first >= REST else noise(x)
    is_coarse = spread < 0.5 * step and FLOOR < 0.5 * step / np.abs(x).max() < COARSEST
    return 0.5 * step if is_coarse else 0.0


def scale(records: Sequence[Record], period: float | None = None) -> Scale:
    """What the records have without any model; the largest values of all of them."""
    found = []
    for record in records:
        each = operations(record, period)
        flux = estimate(record, each)
        largest = (float(np.abs(x).max()) for x in (record.current, flux.flux_linkage))
        found.append(Scale(float(np.median(flux.resistances)), abs(coil(record, each[0])[0]), *largest))
    R, L, i, lam = np.array(found).T
    return Scale(float(np.median(R)), float(np.median(L)), float(i.max()), float(lam.max()))
