"""Which model records are fitted with: a coil that does not move, or a solenoid valve."""

from __future__ import annotations

from collections.abc import Sequence

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.problems import InputError
from gapsense.studies.identification.coil import fit
from gapsense.studies.identification.coil.fit import Coil
from gapsense.studies.identification.valve import guess
from gapsense.studies.records.conventions import AUTO
from gapsense.studies.records.record import Record
from gapsense.workers import Progress

NEITHER = (
    "Nor does a coil without motion explain the current: what it leaves is {:.2g} times the noise. `--model coil` fits"
    " one all the same."
)


def coil_of(
    model: str,
    records: Sequence[Record],
    known: Parameters,
    period: float | None,
    conventions: Sequence[str],
    progress: Progress = lambda done, total: None,
) -> tuple[Coil | None, list[str]]:
    """The coil, if it is wanted or explains all records, and what to say; else the guess of a valve is checked."""
    found, told = None, list[str]()
    if model in (AUTO, "coil"):
        found = fit.identify(records, period, conventions, model == "coil", progress)
        if model == "coil" or found.is_explained:
            return found, told
        is_coil = [fit.identify([r], period, conventions, False).is_explained for r in records if len(records) > 1]
        if is_coil and all(is_coil):
            told = ["Each record is that of a coil without motion, but no one coil explains them all."]
            return fit.identify(records, period, conventions, progress=progress), told
        told = [
            f"{record.name}: a coil without motion explains it, but not the others."
            for record, is_one in zip(records, is_coil)
            if is_one
        ]
    try:
        guess.check(known, records, period)
    except InputError as error:
        worst = max((r.rms / r.noise for r in found.residuals), default=0.0) if found else 0.0
        raise InputError([*error.problems, *([NEITHER.format(worst)] if found else [])]) from None
    return None, told
