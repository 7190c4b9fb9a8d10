"""The gap law of measured inductances, which the fit holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.identification.gap_law import choice
from gapsense.identification.gap_law.eddy import remarks
from gapsense.identification.gap_law.table import read_inductances
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.forms import Sought
from gapsense.identification.valve.gap.start import TURNS, Gap, noises
from gapsense.problems import InputError
from gapsense.report.table import quantity


def of_inductances(
    file: Path, par: Parameters, records: Sequence[Record], sought: Sought, conventions: Sequence[str]
) -> Gap:
    """The gap law of a table of inductances, held; which part of the rest is the core's follows from saturation."""
    measured, turns = read_inductances(file), float(par.coil_turns)
    if measured.gap[-1] < 0.5 * par.stop_upper:
        raise InputError(
            [
                f"{file.name}: gaps up to {quantity(float(measured.gap[-1]), 'm')} found, at least half of the largest,"
                f" {quantity(float(par.stop_upper), 'm')}, expected. Correct `stop.upper`, or measure at larger gaps."
            ]
        )
    law = choice.best(choice.candidates(measured.gap, turns**2 / measured.inductance)).law
    known = par._replace(gap_law=float(GapLaw.table), core_reluctance=law.offset)
    told = [
        f"The gap law is that of {file.name}, `{law.name}`, for {turns:g} turns; both are held. Their errors are"
        " not in the standard errors of the others.",
        *remarks(measured),
    ]
    sought = sought._replace(held=(*sought.held, TURNS), gap=(), law=law, total=law.offset)
    return Gap(
        parameters=known, sought=sought, records=records, conventions=conventions, told=[*told, *noises(records)]
    )
