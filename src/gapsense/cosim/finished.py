"""From a recording to a result with its metrics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gapsense.cosim.metrics import measure_all
from gapsense.cosim.record import Result, Timing
from gapsense.cosim.recording import Recording, Take
from gapsense.cosim.scenario import Scenario
from gapsense.cosim.subject import Subject


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
        run=replace(subject.run, seeds=dict(take.seeds), files=subject.hashes(), overruns=overruns, lag=lag),
        times=times(subject.scenario, recording.rows),
        signals=dict(zip(subject.about, recording.data[: recording.rows].T.copy())),
        about=subject.about,
        parameters=recording.parameters,
        timing=dict(zip(subject.run.order, map(Timing, recording.seconds, recording.calls))),
        wall=recording.wall,
        interrupted=recording.interrupted,
        messages=tuple(recording.messages),
    )


def times(scenario: Scenario, rows: int) -> npt.NDArray[np.float64]:
    """Times of the rows [s], each with the bits of `Experiment.time`."""
    experiment = scenario.experiment
    steps = np.arange(rows, dtype=np.float64) * scenario.record.decimation  # exact: there are fewer than 2**53
    return experiment.start + steps * experiment.base_step
