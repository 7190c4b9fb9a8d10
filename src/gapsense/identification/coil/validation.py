"""How well an identified coil predicts a record that was not used for the fit."""

from __future__ import annotations

import numpy as np

from gapsense.identification.coil.fit import Coil, trajectory
from gapsense.identification.measurements.operations import starts
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.validation import Validation


def validate(result: Coil, record: Record) -> Validation:
    """The coil beside a record that begins at rest, with what the instruments hid in the records used."""
    first = starts(record)[0]
    voltage, current = np.mean(result.offsets, axis=0).tolist()
    model = trajectory(result.parameters, record, first, voltage, current)
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
