"""Records as they are read, with what is fitted to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.causes import Signals, changed
from gapsense.identification.measurements.flux import Flux
from gapsense.identification.measurements.record import Record, between
from gapsense.identification.valve import model
from gapsense.identification.valve.form import FACTOR, Form
from gapsense.identification.valve.model import Experiment

UNKNOWN = float("nan")  # resistance, which these causes do not need


class First(NamedTuple):
    """First operation of a record."""

    record: Record
    experiment: Experiment
    start: int  # its first sample in the record
    resistance: float  # of the last operation by (23), before and after which a core is magnetised alike [Ohm]

    def of(self, form: Form) -> Experiment:
        """What a form is fitted to: with the other resistance where the core stays magnetised after the first one."""
        if FACTOR not in form.fitted:
            return self.experiment
        return model.with_resistance(self.experiment, np.full_like(self.experiment.resistance, self.resistance))


class Prepared(NamedTuple):
    """Records, and what is fitted to them."""

    records: Sequence[Record]
    experiments: list[Experiment]
    fluxes: list[Flux]
    raw: Sequence[Record]  # as they were read
    period: float | None = None
    convention: str = ""  # the voltage between samples; none: as the records have it

    @property
    def drive(self) -> Mapping[str, float]:
        """Values of the causes that are taken out of all records."""
        return self.raw[0].drive

    def moved(self, by: Mapping[str, float]) -> Prepared:
        """The same with other values of the causes."""
        values = {**self.drive, **{name: self.drive.get(name, 0.0) + change for name, change in by.items()}}
        return prepare([record._replace(drive=values) for record in self.raw], self.period, self.convention)

    @property
    def firsts(self) -> list[First]:
        """Their first operations."""
        every = zip(self.records, self.experiments, self.fluxes)
        return [
            First(record, model.shortened(e), flux.operations[0].start, float(flux.resistances[-1]))
            for record, e, flux in every
        ]


def prepare(records: Sequence[Record], period: float | None, convention: str = "") -> Prepared:
    """Records with the voltage between samples that is named, or else as they have it."""
    read = [without_causes(record, convention) for record in records]
    experiments, fluxes = zip(*(model.prepare(record, period) for record in read))
    return Prepared(
        records=read, experiments=[*experiments], fluxes=[*fluxes], raw=records, period=period, convention=convention
    )


def without_causes(record: Record, convention: str = "") -> Record:
    """The record as the model is to explain it: with the voltage between its samples, and less what its driver takes.

    To be used once: the samples of its voltage stay what was recorded.
    """
    read = between(record, convention) if convention else record
    if not record.drive:
        return read
    after = changed(Signals(read.halves, read.current, read.dt, UNKNOWN), record.drive)
    return read._replace(halves=after.halves, current=after.current)
