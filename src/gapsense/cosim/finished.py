"""From a recording to a result: what was run, on what, and its metrics."""

from __future__ import annotations

import os
import platform
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from gapsense.cosim.descriptions import Descriptions
from gapsense.cosim.loop import language
from gapsense.cosim.metrics import measure
from gapsense.cosim.order import execution_order
from gapsense.cosim.record import Result, Run, Signal, Timing
from gapsense.cosim.recording import Recording, Take
from gapsense.cosim.scenario import Scenario
from gapsense.cosim.signals import recorded_signals
from gapsense.files import sha256


def finished(scenario: Scenario, descriptions: Descriptions, take: Take, recording: Recording) -> Result:
    """Result of a recording with its metrics; raises FmuError with the partial result if a component has failed."""
    result = to_result(scenario, descriptions, take, recording)
    if recording.error is not None:
        recording.error.result = replace(result, failure=str(recording.error))
        raise recording.error
    metrics = () if result.interrupted else scenario.metrics
    return replace(result, metrics={metric.name: measure(metric, result) for metric in metrics})


def to_result(scenario: Scenario, descriptions: Descriptions, take: Take, recording: Recording) -> Result:
    """Result of a recording, without metrics."""
    decimation, experiment = scenario.record.decimation, scenario.experiment
    known = recorded_signals(scenario, descriptions)
    run = about(scenario, descriptions, take, recording)
    return Result(
        run=run,
        times=np.array([experiment.time(row * decimation) for row in range(recording.rows)]),
        signals=dict(zip(known, recording.data[: recording.rows].T.copy())),
        about={name: Signal(v.unit or "", v.nominal, v.causality) for name, v in known.items()},
        parameters=recording.parameters,
        timing=dict(zip(run.order, map(Timing, recording.seconds, recording.calls))),
        wall=recording.wall,
        interrupted=recording.interrupted,
        messages=tuple(recording.messages),
    )


def about(scenario: Scenario, descriptions: Descriptions, take: Take, recording: Recording) -> Run:
    """What was run and how."""
    experiment = scenario.experiment
    order = execution_order(list(scenario.components), scenario.connections, descriptions)
    return Run(
        title=scenario.title,
        scenario=scenario.name,
        variant=scenario.variant,
        method=experiment.method,
        start=experiment.start,
        stop=experiment.stop,
        base_step=experiment.base_step,
        decimation=scenario.record.decimation,
        seeds=dict(take.seeds),
        components={name: component_facts(scenario, descriptions, name) for name in scenario.components},
        order=order.names,
        delayed=tuple(str(connection) for connection in order.delayed),
        files=file_hashes(scenario),
        versions=versions(),
        overruns=recording.overruns,
        lag=recording.lag,
        source=str(scenario.path.resolve()),
        figure=scenario.figure,
    )


def file_hashes(scenario: Scenario) -> dict[str, str]:
    """Hash of each file of a scenario, by its path from the scenario's folder, and of what stands in none."""
    folder = scenario.path.parent.resolve()
    files = {Path(os.path.relpath(file.resolve(), folder)).as_posix(): sha256(file) for file in scenario.files}
    return {**files, **scenario.hashes}


def component_facts(scenario: Scenario, descriptions: Descriptions, name: str) -> dict[str, Any]:
    """FMU and grid of a component."""
    component, description = scenario.components[name], descriptions[name]
    facts = {key: getattr(description, key) for key in ("guid", "version", "sha256")}
    return {"fmu": description.path.name, **facts, "step": component.step, "offset": component.offset}


def versions() -> dict[str, str]:
    """Versions of what computed the result, and the language that the loop over base steps is in."""
    return {
        **{package: installed(package) for package in ("gapsense", "fmpy", "numpy")},
        "loop": language(),
        "python": platform.python_version(),
        "platform": platform.platform(),
    }


def installed(package: str) -> str:
    """Version of an installed package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
