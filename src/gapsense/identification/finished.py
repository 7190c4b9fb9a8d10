"""What comes of an identification: the file is written, and this is to be shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from matplotlib.figure import Figure
from rich.table import Table

from gapsense.identification import temperature
from gapsense.identification.asked import Asked, Given
from gapsense.identification.coil import file as coil_file
from gapsense.identification.coil import show as coil_show
from gapsense.identification.coil import validation as coil_validation
from gapsense.identification.coil.fit import Coil
from gapsense.identification.measurements.record import between
from gapsense.identification.noise import noises
from gapsense.identification.valve import drive, file, show, validation
from gapsense.identification.valve.gap import result as gap
from gapsense.identification.valve.gap.start import Gap
from gapsense.identification.valve.identified import Identified
from gapsense.identification.valve.prepared import without_causes


class Finished(NamedTuple):
    """For the user."""

    shown: Sequence[Table | str]
    figure: Callable[[], Figure]
    is_explained: bool


def valve(asked: Asked, given: Given, start: Gap, result: Identified) -> Finished:
    """A valve, written."""
    records, R = start.records, result.resistance
    coefficient = temperature.coefficient(records, result.fluxes)
    convention = result.convention or asked.how.convention
    kept = [between(record._replace(drive=result.drive), convention) for record in given.kept]
    checks = validation.validated(result.parameters, kept, coefficient)
    notes = [*drive.notes(result.drive), *temperature.notes(R, coefficient)]
    law = gap.kept(given.known, result, asked.to)
    file.write_identified(asked.to, result, law, asked.data, noises(records), notes)
    doubts = drive.doubtful(R, given.known.resistance)
    tables = [*start.told, *show.tables(result, records, checks), *gap.told(result, records)]
    return Finished(
        shown=[*tables, *temperature.tables(records, R, coefficient), *doubts],
        figure=lambda: show.measured_and_identified(result, records, checks),
        is_explained=result.is_explained and not doubts,
    )


def coil(asked: Asked, given: Given, result: Coil) -> Finished:
    """A coil, written."""
    kept = [without_causes(record, result.convention) for record in given.driven]
    checks = [coil_validation.validate(result, record) for record in kept]
    turns = given.known.parameters.coil_turns if "coil_turns" in given.known.given else 0.0
    coil_file.write(asked.to, result, turns, asked.data)
    return Finished(
        shown=coil_show.tables(result, turns, checks),
        figure=lambda: coil_show.measured_and_identified(result, checks),
        is_explained=result.is_explained,
    )
