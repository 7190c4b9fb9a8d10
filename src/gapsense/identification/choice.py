"""Which model records are fitted with: a coil that does not move, or a solenoid valve."""

from __future__ import annotations

from collections.abc import Sequence

from gapsense._os.workers import Progress
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.coil import fit
from gapsense.identification.coil.fit import Coil
from gapsense.identification.measurements.conventions import AUTO
from gapsense.identification.measurements.operations import operations
from gapsense.identification.measurements.record import Record, until
from gapsense.identification.valve import guess
from gapsense.problems import InputError

MANY = 5000  # samples from which the first operations are looked at alone
FAR = 2.0  # times what a coil may leave of them
NEITHER = (
    "Nor does a coil without motion explain the current: what it leaves is {:.2g} times the noise. `--model coil` fits"
    " one all the same."
)


def quick(records: Sequence[Record], period: float | None, conventions: Sequence[str]) -> Coil | None:
    """The coil of the first operations alone, if no coil explains any of them: then none explains the records."""
    firsts = [until(record, operations(record, period)[0].stop) for record in records]
    if not all(operations(record, period) for record in firsts):
        return None
    each = [fit.identify([record], period, conventions, False) for record in firsts]
    if any(r.rms < FAR * r.limit for coil in each for r in coil.residuals):
        return None
    return max(each, key=lambda coil: coil.residuals[0].rms / coil.residuals[0].noise)


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
    if model == AUTO and sum(record.times.size for record in records) > MANY:
        found = quick(records, period, conventions)
    if model == "coil" or (model == AUTO and found is None):
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
