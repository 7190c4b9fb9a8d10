"""Run a scenario: from its file to a result, with everything checked on the way."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from gapsense.cosim.apart import Plan, Watch, record_apart, tell
from gapsense.cosim.check import check_scenario, read_descriptions
from gapsense.cosim.check_values import taken
from gapsense.cosim.checkpoint import Checkpoint, Keeper, keeper
from gapsense.cosim.descriptions import Description, Descriptions
from gapsense.cosim.document import Source, scenario_file
from gapsense.cosim.load import read_draft
from gapsense.cosim.master import Master, Progress
from gapsense.cosim.metrics import measure
from gapsense.cosim.order import execution_order
from gapsense.cosim.record import Result, Run, Signal, Timing
from gapsense.cosim.recording import Recording, Take
from gapsense.cosim.scenario import ISOLATIONS, Scenario
from gapsense.cosim.signals import ports, recorded_signals
from gapsense.files import sha256
from gapsense.interrupts import counted
from gapsense.problems import ScenarioError, suggest
from gapsense.shipped import FMU_FOLDER, FMUS


def run(
    scenario: Source,
    variant: str | None = None,
    fmus: str | Path | None = None,
    seed_shift: int = 0,
    progress: Progress | None = None,
    point: int | None = None,
    isolation: str | None = None,
    step_limit: float | None = None,
    checkpoint: Checkpoint | None = None,
    notice: Callable[[str], None] = tell,
) -> Result:
    """Run a scenario and measure its metrics.

    Parameters
    ----------
    scenario : str, Path or Document
        Scenario file, its folder, or its content.
    variant : str, optional
        Variant of the scenario.
    fmus : str or Path, optional
        Folder of the FMUs; by default `build/fmus` in a folder above the scenario, or below the working
        directory, or else those that come with Gapsense.
    seed_shift : int
        Added to every seed of the scenario.
    progress : callable, optional
        Called now and then with base steps done and base steps in all.
    point : int, optional
        Combination of the values in `[sweep]`, counted from 0; by default the components' own values.
    isolation : str, optional
        `"process"`: in a process of its own, so that no component can end or block this one. By default what the
        scenario says in `[experiment]`, and without that `"none"`: in this process.
    step_limit : float, optional
        Wall time [s] that one step of a component in another process may take; by default what the scenario says.
    checkpoint : Checkpoint, optional
        Where the run saves itself now and then, and whether it goes on from there.
    notice : callable, optional
        Called with a sentence when a Ctrl-C has to wait for a component; by default it is printed.

    Returns
    -------
    Result
        Complete, or after Ctrl-C up to there and marked `interrupted`.

    Raises
    ------
    ScenarioError
        If the scenario or its FMUs are wrong, with all problems found.
    FmuError
        If a component fails; `result` of the error holds what was recorded before.
    """
    read, descriptions = prepare(scenario, variant, fmus)
    read = isolated(read, isolation, step_limit)
    take = taken_run(read, descriptions, seed_shift, point)
    kept = keeper(checkpoint, read, descriptions, take) if checkpoint else None
    if read.experiment.isolation == "process":
        recording = record_apart(Plan(read, descriptions, take, kept), Watch(progress, notice))
        return finished(read, descriptions, take, recording)
    with Master(read, descriptions) as master:
        return run_once(master, seed_shift, progress, point, kept)


def isolated(scenario: Scenario, isolation: str | None, step_limit: float | None) -> Scenario:
    """A scenario with another isolation and limit, where they are given."""
    experiment = scenario.experiment
    isolation, limit = isolation or experiment.isolation, step_limit or experiment.step_limit
    if isolation not in ISOLATIONS:
        raise ValueError(f"`isolation` is {isolation!r}. {suggest(isolation, ISOLATIONS)}")
    return replace(scenario, experiment=replace(experiment, isolation=isolation, step_limit=limit))


def check(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> list[str]:
    """Problems of a scenario, found without running it.

    Parameters
    ----------
    scenario : str, Path or Document
        Scenario file, its folder, or its content.
    variant : str, optional
        Variant to check; by default the scenario as it is and then every variant.
    fmus : str or Path, optional
        Folder of the FMUs, as in `run`.

    Returns
    -------
    list of str
        One sentence each with file, place, what was found, what was expected and what to do; empty if all is well.
    """
    problems, read = inspect(scenario, variant, fmus)[:2]
    if variant is None and read is not None:
        for name in read.variants:
            more = [f"variant {name}: {p}" for p in inspect(scenario, name, fmus)[0] if p not in problems]
            problems = problems + more
    return problems


def prepare(
    scenario: Source, variant: str | None = None, fmus: str | Path | None = None
) -> tuple[Scenario, dict[str, Description]]:
    """Scenario and model descriptions, checked; raises ScenarioError with all problems of both."""
    problems, read, descriptions = inspect(scenario, variant, fmus)
    if problems or read is None:
        raise ScenarioError(problems)
    return read, descriptions


def inspect(
    scenario: Source, variant: str | None, fmus: str | Path | None
) -> tuple[list[str], Scenario | None, dict[str, Description]]:
    """Problems of file and FMUs together, the scenario as far as it could be read, and the model descriptions."""
    draft = read_draft(scenario, variant)
    if draft.scenario is None:
        return draft.problems, None, {}
    problems = list(draft.problems)
    folder = Path(fmus) if fmus is not None else find_fmus(scenario_file(scenario))
    descriptions = read_descriptions(draft.scenario, folder, problems)
    read = taken(draft.scenario, descriptions)
    problems += check_scenario(read, descriptions, draft.broken)
    return problems, read, descriptions


def find_fmus(scenario: Path) -> Path:
    """Folder `build/fmus` in a folder above the scenario, or below the working directory, or else what was shipped."""
    above = (folder / FMU_FOLDER for folder in scenario.resolve().parents)
    return next((folder for folder in (*above, FMU_FOLDER, FMUS) if folder.is_dir()), FMU_FOLDER)


def run_once(
    master: Master,
    seed_shift: int = 0,
    progress: Progress | None = None,
    point: int | None = None,
    kept: Keeper | None = None,
) -> Result:
    """One run of a loaded scenario; raises FmuError with the partial result if a component fails.

    A KeyboardInterrupt must not be raised inside a Python FMU, which runs in this very interpreter: the first Ctrl-C
    is asked for between steps.  After the second one whatever fails does so because of it.
    """
    scenario, descriptions = master.scenario, master.descriptions
    take = taken_run(scenario, descriptions, seed_shift, point)
    with counted(at_most=1) as interrupts:
        recording = master.run(take.columns, take.seeds, progress, interrupts, take.values, keeper=kept)
        if interrupts() > 1:
            recording.error, recording.interrupted = None, True
    return finished(scenario, descriptions, take, recording)


def taken_run(scenario: Scenario, descriptions: Descriptions, seed_shift: int = 0, point: int | None = None) -> Take:
    """What one run of a scenario takes."""
    known = recorded_signals(scenario, descriptions)
    return Take(
        columns=[place for place, port in enumerate(ports(descriptions)) if str(port) in known],
        seeds={name: seed + seed_shift for name, seed in scenario.seeds.items()},
        values={} if point is None else scenario.points()[point],
    )


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
    """Versions of what computed the result."""
    return {
        **{package: installed(package) for package in ("gapsense", "fmpy", "numpy")},
        "python": platform.python_version(),
        "platform": platform.platform(),
    }


def installed(package: str) -> str:
    """Version of an installed package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
