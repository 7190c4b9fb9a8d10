"""Records as they are read, with what is fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gapsense.studies.identification.valve import model
from gapsense.studies.identification.valve.model import Experiment
from gapsense.studies.records.flux import Flux
from gapsense.studies.records.record import Record, between


class First(NamedTuple):
    """First operation of a record."""

    record: Record
    experiment: Experiment
    start: int  # its first sample in the record


class Prepared(NamedTuple):
    """Records, and what is fitted to them."""

    records: Sequence[Record]
    experiments: list[Experiment]
    fluxes: list[Flux]

    @property
    def firsts(self) -> list[First]:
        """Their first operations."""
        starts = (flux.operations[0].start for flux in self.fluxes)
        return [First(r, model.shortened(e), start) for r, e, start in zip(self.records, self.experiments, starts)]


def prepare(records: Sequence[Record], period: float | None, convention: str = "") -> Prepared:
    """Records with the voltage between samples that is named, or else as they have it."""
    records = [between(record, convention) for record in records] if convention else records
    experiments, fluxes = zip(*(model.prepare(record, period) for record in records))
    return Prepared(records, [*experiments], [*fluxes])
