"""From a recording to a result with its metrics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.cosim.events.event import Span
from gapsense.cosim.fmu.instance import WARNING, summary
from gapsense.cosim.result.measure import measure_all
from gapsense.cosim.result.result import Result, Timing
from gapsense.cosim.run.durations import median
from gapsense.cosim.run.recording import Recording, Take
from gapsense.cosim.run.subject import Subject
from gapsense.cosim.scenario.records import Scenario


def finished(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of a recording with its metrics; raises FmuError with the partial result if a component has failed."""
    result = to_result(subject, take, recording)
    if recording.error is not None:
        recording.error.result = replace(result, failure=str(recording.error))
        raise recording.error
    return result if result.interrupted else replace(result, metrics=measure_all(subject.scenario.metrics, result))


def to_result(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of a recording, without metrics."""
    overruns, lag = recording.overruns, recording.lag
    return Result(
        run=replace(
            subject.run,
            seeds=dict(take.seeds),
            files=subject.hashes(),
            overruns=overruns,
            lag=lag,
            remarks=(*subject.run.remarks, *remarks(subject, recording)),
        ),
        times=times(subject.scenario, recording.rows),
        signals=dict(zip(subject.about, recording.data[: recording.rows].T.copy())),
        about=subject.about,
        parameters=recording.parameters,
        timing=dict(zip(subject.run.order, timings(recording))),
        wall=recording.wall,
        interrupted=recording.interrupted,
        ended=recording.ended,
        messages=tuple(recording.messages),
        events=tuple(spans(subject.scenario, recording.events)),
    )


def remarks(subject: Subject, recording: Recording) -> Iterator[str]:
    """Sentences on what components did in the run that is no failure: the end of it, warnings."""
    if recording.ended:
        yield recording.ended
    for name, warnings, calls in zip(subject.run.order, recording.warnings, recording.calls):
        if warnings:
            texts = [text for component, status, text in recording.messages if (component, status) == (name, WARNING)]
            said = f"; the last one says: {summary(texts[-1]).rstrip('.')}" if texts else " without a word"
            yield f"`{name}` returned a warning from {warnings} of {calls} steps{said}."


def timings(recording: Recording) -> Iterator[Timing]:
    """Time of each component, in execution order."""
    for seconds, calls, longest, spread in zip(recording.seconds, recording.calls, recording.longest, recording.spread):
        yield Timing(seconds, calls, median(spread, longest), longest if calls else None)


def spans(scenario: Scenario, happened: Sequence[Sequence[Any]]) -> Iterator[Span]:
    """When each event was on; of an event that was on at the end, the end is not known."""
    time = scenario.experiment.time
    for name, begin, end in happened:
        event = scenario.events[name]
        yield Span(
            name=name,
            target=str(event.target),
            action=event.action,
            begin=time(begin),
            end=None if end is None else time(end),
        )


def times(scenario: Scenario, rows: int) -> npt.NDArray[np.float64]:
    """Times of the rows [s], each with the bits of `Experiment.time`."""
    experiment = scenario.experiment
    steps = np.arange(rows, dtype=np.float64) * scenario.record.decimation  # exact: there are fewer than 2**53
    return experiment.start + steps * experiment.base_step
