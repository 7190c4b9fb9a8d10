"""What the user asks of an identification, and what the files hold that were named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification import temperature
from gapsense.identification.assumptions import ask
from gapsense.identification.gap_law.laws import Law
from gapsense.identification.measurements.checks import read_records
from gapsense.identification.measurements.conventions import AUTO, CONVENTIONS
from gapsense.identification.measurements.record import Reading, Record
from gapsense.identification.options import sought
from gapsense.identification.valve.drive import Drive, drive_of
from gapsense.identification.valve.file import BY_NAME, PORTS, Known, read_known
from gapsense.identification.valve.forms import Sought, plain
from gapsense.identification.valve.gap.start import TURNS
from gapsense.identification.valve.scales import missing
from gapsense.report import plot

TABLE_I = "[SEMERA] Table I"
HOLD = " (in place of `gap.slope` also `coil.turns`, with `--hold coil.turns`)"
LAW = Law("sought", 0.0, ())


class Asked(NamedTuple):
    """The options of the command; from `model` on those that commissioning has not."""

    data: Sequence[Path]
    how: Reading  # the files are read
    to: Path
    validate: Sequence[Path]
    figure: Path | None
    parameters: Path | None
    assume: bool
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
    asked: Asked

    def ask(self) -> None:
        """Ask for what a valve needs that the user has not given, before anything is fitted."""
        is_law_known = bool({"gap_law", "gap_slope", "gap_area"} & self.known.given)
        has_position = any(record.position is not None for record in self.records)
        is_told = self.asked.inductance is not None or (has_position and not is_law_known)
        sought = self.sought._replace(held=(*self.sought.held, TURNS), gap=()) if is_told else self.sought
        self.ask_for(self.known.parameters, sought)

    def ask_for(self, parameters: Parameters, sought: Sought) -> None:
        """The same, with what is sought of the gap."""
        form = plain(parameters, sought)
        names = missing(form if sought.gap is None else form._replace(law=LAW), self.known.given)
        if not self.asked.assume:
            file = self.asked.parameters
            where = file.name if file else "--parameters"
            more = HOLD if "gap_slope" in names else ""
            ask([PORTS[name].name for name in names], BY_NAME, where, TABLE_I, more)

    @property
    def driven(self) -> list[Record]:
        """The kept records, with what is known of the driver."""
        return [record._replace(drive=self.drive.values) for record in self.kept]


def read(asked: Asked) -> Given:
    """Read all files; an error tells what is wrong with them or with an option."""
    if asked.figure is not None:
        plot.check_file(asked.figure)
    known, drive = read_known(asked.parameters), drive_of(asked.driver, asked.accuracy)
    seeking = sought(asked.forms, asked.hold, known, drive.accuracy)
    records = temperature.given(asked.temperatures, read_records(asked.data, asked.how, asked.period))
    is_open = asked.how.convention == AUTO and not all(record.is_mean for record in records)
    return Given(
        known=known,
        drive=drive,
        sought=seeking,
        records=[record._replace(drive=drive.values) for record in records],
        kept=read_records(asked.validate, asked.how, needs="rest"),
        conventions=CONVENTIONS if is_open else (),
        asked=asked,
    )
