"""How well identified parameters predict a record that was not used for the fit, [UKF] Fig. 7."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.studies.identification.device import Device, value
from gapsense.studies.identification.model import Trajectory, simulate
from gapsense.studies.identification.operations import starts
from gapsense.studies.identification.record import Record


class Validation(NamedTuple):
    """Model against measurement."""

    record: Record
    model: Trajectory  # from sample `first` on
    first: int  # the last sample at rest
    rms: float  # of the error of the model's current [A]
    largest: float  # the same
    largest_current: float  # [A]


def validate(par: Device, record: Record) -> Validation:
    """The model, with its own resistance, beside a record that begins at rest."""
    first = starts(record)[0]
    halves = record.halves[first:]
    model = simulate(par, halves, record.dt, np.full(len(halves), value(par, "coil_resistance")))
    error = np.abs(record.current[first:] - model.current)
    rms = float(np.sqrt(np.mean(error**2)))
    return Validation(record, model, first, rms, float(error.max()), float(np.abs(record.current).max()))
