"""Measured positions that can be fitted: their noise, their offset, and what is no gap of this valve."""

from __future__ import annotations

import numpy as np

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.operations import hidden, noise, operations
from gapsense.identification.measurements.record import Record
from gapsense.problems import InputError
from gapsense.report.table import quantity

EXACT = 1e-3  # of the stroke: a position is no better, whatever its noise
MOVES = 0.05  # of the stroke, that a position has to change
BEYOND = 0.25  # of the stroke, that a position may be outside of the stops


def usable(record: Record, par: Parameters, period: float | None = None) -> Record:
    """The record with the noise of its position and without the offset of that, if something moves."""
    stroke = float(par.stop_upper - par.stop_lower)
    if record.position is None or float(np.ptp(record.position)) < MOVES * stroke:
        return record
    rest = operations(record, period)[0].start + 1
    start = float(np.clip(par.initial_position, par.stop_lower, par.stop_upper))
    z = record.position - float(np.median(record.position[:rest])) + start
    if z.min() < par.stop_lower - BEYOND * stroke or z.max() > par.stop_upper + BEYOND * stroke:
        ends = f"{quantity(float(record.position.min()), 'm')} to {quantity(float(record.position.max()), 'm')}"
        raise InputError(
            [
                f"{record.name}: `position` is {ends}, beginning with"
                f" {quantity(float(np.median(record.position[:rest])), 'm')}; the gap, from"
                f" {quantity(float(par.stop_lower), 'm')} to {quantity(float(par.stop_upper), 'm')} and beginning with"
                f" {quantity(start, 'm')}, is expected. Correct unit or direction, `stop.lower`, `stop.upper` or"
                " `initial.position`, or rename the column."
            ]
        )
    return record._replace(position=z, position_noise=max(noise(z), hidden(z), EXACT * stroke))
