"""Runs of devices with each fault and without one, and what `Monitor` says of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.estimators.monitor.records import Verdict
from gapsense.estimators.monitor.signatures import CAUSES
from gapsense.studies.runs import signals

from .cases import COURSE, HEALTHY, OPERATION, START, STEP, Case, Course, devices, document, times

NAMES = ["monitor.verdict", "monitor.cause", "monitor.faults"]
EACH = 5  # base steps from row to row
SHIFT = 1000  # seeds of sensors are those of devices, times this
LATE = 3  # operations within which a fault is to be told, and those within which a device is to be healthy again
AGAIN = 5
SLACK = 0.1  # operations that a judgement may be late by: the command is read a sample later

Array = npt.NDArray[np.float64]


class Span(NamedTuple):
    """What was said of a span with a fault; times in operations, infinite where it was never said."""

    told: float
    cause: str  # at the end of the span; empty: none
    is_lasting: bool  # the device was faulty at the end, by the verdict
    passed: float


def times_of(count: int) -> Array:
    """Of rows [s]."""
    return np.asarray(START + np.arange(count) * EACH * STEP)


def judged(case: Case, count: int, seed: int, tell: Callable[[int], None], course: Course = COURSE) -> list[list[Span]]:
    """Spans of each device whose run was not lost."""
    shifts = [SHIFT * seed + k for k in range(count)]
    runs = signals(document(case, NAMES, course, EACH), None, NAMES, devices(count, seed), shifts)
    found = []
    for done, (_, rows) in enumerate(runs, 1):
        if rows is not None:
            found.append([said(rows, *span) for span in times(case, course)])
        tell(done)
    return found


def said(rows: Array, begin: float, end: float) -> Span:
    """What was said of one span."""
    t, (verdict, cause, faults) = times_of(len(rows)), rows.T
    before, last = int(np.searchsorted(t, begin)) - 1, int(np.searchsorted(t, end)) - 1
    is_told = (t > begin) & (t < end) & (faults > faults[before])
    is_healthy = (t > end) & (verdict == float(Verdict.healthy))
    number = int(cause[last])
    return Span(
        told=_first(t, is_told, begin) if verdict[before] != float(Verdict.faulty) else np.inf,
        cause=CAUSES[number - 1] if number else "",
        is_lasting=bool(verdict[last] == float(Verdict.faulty)),
        passed=_first(t, is_healthy, end),
    )


def _first(t: Array, is_so: npt.NDArray[np.bool_], since: float) -> float:
    """Operations until something is so for the first time."""
    found = np.flatnonzero(is_so)
    return float(t[found[0]] - since) / OPERATION if found.size else np.inf


class Alarms(NamedTuple):
    """Of healthy devices."""

    operations: int  # that were judged, after the baseline
    faults: int
    worn: int  # devices that were called worn at any time


def alarms(count: int, seed: int, course: Course, tell: Callable[[int], None]) -> Alarms:
    """What was said of healthy devices in a course."""
    shifts = [SHIFT * seed + k for k in range(count)]
    runs = signals(document(HEALTHY, NAMES, course, EACH), None, NAMES, devices(count, seed), shifts)
    operations = faults = worn = 0
    for done, (_, rows) in enumerate(runs, 1):
        if rows is not None:
            verdict, _, told = rows.T
            operations += int(np.mean(verdict > 0.0) * course.operations)
            faults += int(told[-1])
            worn += int(np.any(verdict == float(Verdict.worn)))
        tell(done)
    return Alarms(operations, faults, worn)


def shares(spans: Sequence[Span], case: Case) -> tuple[float, float, float]:
    """Told in time, with the right cause at the end, healthy again in time."""
    return (
        float(np.mean([s.told <= LATE + SLACK for s in spans])),
        float(np.mean([s.cause in case.causes for s in spans])),
        float(np.mean([s.passed <= AGAIN + SLACK for s in spans])),
    )
