"""Records as they are read, with what is fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.studies.identification.valve import model
from gapsense.studies.identification.valve.form import FACTOR, Form
from gapsense.studies.identification.valve.model import Experiment
from gapsense.studies.records.flux import Flux
from gapsense.studies.records.record import Record, between


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
    records = [between(record, convention) for record in records] if convention else records
    experiments, fluxes = zip(*(model.prepare(record, period) for record in records))
    return Prepared(records, [*experiments], [*fluxes])
