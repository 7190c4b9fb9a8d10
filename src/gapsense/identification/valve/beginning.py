"""What the first operations of records tell: the best start, the reading of the voltage, the form, and the causes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gapsense._os.workers import Progress
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.course import Course, expected
from gapsense.identification.valve.drive import Drive, settled, taken, timed
from gapsense.identification.valve.evidence import Trial
from gapsense.identification.valve.forms import Sought
from gapsense.identification.valve.minimise import Fit, Start
from gapsense.identification.valve.prepared import Prepared, prepare
from gapsense.identification.valve.voltage import best_reading


class Method(NamedTuple):
    """How the minimum is sought; see `identify`."""

    starts: int
    seed: int
    conventions: Sequence[str]


def course_of(prepared: Prepared, method: Method, sought: Sought, progress: Progress) -> Course:
    """What is to be expected of a fit."""
    firsts = sum(first.experiment.current.size for first in prepared.firsts)
    whole = sum(e.current.size for e in prepared.experiments)
    phases = expected(firsts, whole, method.starts, len(method.conventions), len(sought.forms))
    return Course(progress, phases, whole)


class Beginning(NamedTuple):
    """What the first operations tell."""

    ratios: Vector
    prepared: Prepared
    starts: list[Start]
    trials: list[Trial]
    causes: Sequence[str]  # that are fitted


def begun(fit: Fit, prepared: Prepared, method: Method, sought: Sought, drive: Drive) -> Beginning:
    """The best start, the reading of the voltage, the form and the causes that explain the first operations best."""
    firsts = [first.experiment for first in prepared.firsts]
    found = fit.multi_start(firsts, method.starts, method.seed) if method.starts else []
    found = [start._replace(cost=fit.cost(start.ratios, prepared.experiments)) for start in found]
    ratios = min(found, key=lambda s: s.cost).ratios if found else fit.form.start
    fit.course.begins("readings")
    if method.conventions:
        readings = [prepare(prepared.raw, prepared.period, name) for name in method.conventions]
        best, ratios = best_reading(fit, ratios, [reading.firsts for reading in readings], sought)
        prepared = readings[best]
    fit.course.begins("forms")
    if not found:
        return Beginning(ratios=ratios, prepared=prepared, starts=found, trials=[], causes=drive.fitted)
    ratios, prepared = settled(fit, ratios, prepared, drive.fitted)
    prepared, trials, causes = timed(fit, ratios, prepared, sought, drive)
    fit.form, ratios = taken(trials)[:2]
    return Beginning(ratios=ratios, prepared=prepared, starts=found, trials=trials, causes=causes)
