"""What the user asks of an identification, and what the files hold that were named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense.report import plot
from gapsense.studies.identification import temperature
from gapsense.studies.identification.options import sought
from gapsense.studies.identification.valve.drive import Drive, drive_of
from gapsense.studies.identification.valve.file import Known, read_known
from gapsense.studies.identification.valve.forms import Sought
from gapsense.studies.records.checks import read_records
from gapsense.studies.records.conventions import AUTO, CONVENTIONS
from gapsense.studies.records.record import Reading, Record


class Asked(NamedTuple):
    """The options of the command; from `model` on those that commissioning has not."""

    data: Sequence[Path]
    how: Reading  # the files are read
    to: Path
    validate: Sequence[Path]
    figure: Path | None
    parameters: Path | None
    model: str
    period: float | None
    temperatures: str | None
    forms: str
    hold: Sequence[str]
    inductance: Path | None
    driver: str | None
    accuracy: str | None


class Given(NamedTuple):
    """What was read."""

    known: Known
    drive: Drive
    sought: Sought
    records: list[Record]
    kept: list[Record]  # for the validation
    conventions: Sequence[str]  # of the voltage between samples, that are left to the fit

    @property
    def driven(self) -> list[Record]:
        """The kept records, with what is known of the driver."""
        return [record._replace(drive=self.drive.values) for record in self.kept]


def read(asked: Asked) -> Given:
    """Read all files; an error tells what is wrong with them or with an option."""
    if asked.figure is not None:
        plot.check_file(asked.figure)
    known, drive = read_known(asked.parameters), drive_of(asked.driver, asked.accuracy)
    seeking = sought(asked.forms, asked.hold, known)
    records = temperature.given(asked.temperatures, read_records(asked.data, asked.how, asked.period))
    is_open = asked.how.convention == AUTO and not all(record.is_mean for record in records)
    return Given(
        known=known,
        drive=drive,
        sought=seeking,
        records=[record._replace(drive=drive.values) for record in records],
        kept=read_records(asked.validate, asked.how, needs="rest"),
        conventions=CONVENTIONS if is_open else (),
    )
