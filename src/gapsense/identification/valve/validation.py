"""How well identified parameters predict a record that was not used for the fit, [UKF] Fig. 7."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.operations import starts
from gapsense.identification.measurements.record import Record
from gapsense.identification.temperature import Coefficient
from gapsense.identification.valve.device import Device, changed, value
from gapsense.identification.valve.model import Trajectory, simulate
from gapsense.identification.valve.prepared import without_causes


class Validation(NamedTuple):
    """Model against measurement."""

    record: Record
    model: Trajectory  # from sample `first` on
    first: int  # the last sample at rest
    rms: float  # of the error of the model's current [A]
    largest: float  # the same
    largest_current: float  # [A]


def validated(par: Device, records: Sequence[Record], coefficient: Coefficient | None) -> list[Validation]:
    """The model beside each of the records, with the resistance at its temperature, if that is known."""
    found = []
    for record in records:
        T = record.temperature
        R = value(par, "coil_resistance") if coefficient is None or T is None else coefficient.at(T)
        found.append(validate(changed(par, coil_resistance=R), record))
    return found


def validate(par: Device, record: Record) -> Validation:
    """The model, with its own resistance, beside a record that begins at rest."""
    first = starts(record)[0]
    halves = without_causes(record).halves[first:]
    model = simulate(par, halves, record.dt, np.full(len(halves), value(par, "coil_resistance")))
    return compared(record, model, first)


def compared(record: Record, model: Trajectory, first: int) -> Validation:
    """The current of a model, which begins at sample `first`, beside that of a record."""
    error = np.abs(record.current[first:] - model.current)
    rms = float(np.sqrt(np.mean(error**2)))
    return Validation(
        record=record,
        model=model,
        first=first,
        rms=rms,
        largest=float(error.max()),
        largest_current=float(np.abs(record.current).max()),
    )
