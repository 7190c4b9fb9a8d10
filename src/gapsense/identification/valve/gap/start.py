"""What is known of the gap before the fit, and how much of it the fit seeks.

Current and flux linkage depend on reluctances over the square of the turns, and so do forces.  Once the gap law is
sought, any turns explain the records alike: they are held, as they are given.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rich.table import Table

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.forms import Sought
from gapsense.report.table import quantity

TURNS = "coil_turns"


class Gap(NamedTuple):
    """What is known, and what is sought."""

    parameters: Parameters  # with first guesses of the gap law and the core
    sought: Sought
    records: Sequence[Record]  # with positions that are to be fitted
    conventions: Sequence[str] = ()  # of the voltage between samples, that are left to the fit
    told: Sequence[Table | str] = ()

    @property
    def more(self) -> tuple[Sequence[str], Sought]:
        """The last arguments of `fit.identify`."""
        return self.conventions, self.sought


def noises(records: Sequence[Record]) -> list[str]:
    """Sentences on the positions that are fitted."""
    return [
        f"{record.name}: the position is fitted too, with a noise of {quantity(record.position_noise, 'm')}."
        for record in records
        if record.position_noise
    ]
