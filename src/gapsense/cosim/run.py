"""Run a scenario: from its file to a result, with everything checked on the way."""

from __future__ import annotations

import os
import platform
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from gapsense.cosim.check import check_scenario, read_descriptions
from gapsense.cosim.check_values import taken
from gapsense.cosim.descriptions import Description, Variable
from gapsense.cosim.document import Source, scenario_file
from gapsense.cosim.load import read_draft
from gapsense.cosim.master import Master, Progress, Recording
from gapsense.cosim.metrics import measure
from gapsense.cosim.record import Result, Run, Signal, Timing
from gapsense.cosim.scenario import Scenario
from gapsense.cosim.signals import recorded_signals
from gapsense.files import sha256
from gapsense.problems import ScenarioError
from gapsense.shipped import FMU_FOLDER, FMUS


def run(
    scenario: Source,
    variant: str | None = None,
    fmus: str | Path | None = None,
    seed_shift: int = 0,
    progress: Progress | None = None,
    point: int | None = None,
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
    with Master(read, descriptions) as master:
        return run_once(master, seed_shift, progress, point)


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


def run_once(master: Master, seed_shift: int = 0, progress: Progress | None = None, point: int | None = None) -> Result:
    """One run of a loaded scenario; raises FmuError with the partial result if a component fails."""
    scenario = master.scenario
    values = {} if point is None else scenario.points()[point]
    seeds = {name: seed + seed_shift for name, seed in scenario.seeds.items()}
    known = recorded_signals(scenario, master.descriptions)
    columns = [place for port, place in master.places.index.items() if str(port) in known]
    with interruptible() as interrupted:
        recording = master.run(columns, seeds, progress, interrupted, values)
    result = to_result(master, known, seeds, recording)
    if recording.error is not None:
        recording.error.result = replace(result, failure=str(recording.error))
        raise recording.error
    metrics = () if result.interrupted else scenario.metrics
    return replace(result, metrics={metric.name: measure(metric, result) for metric in metrics})


def to_result(master: Master, known: Mapping[str, Variable], seeds: Mapping[str, int], recording: Recording) -> Result:
    """Result of a recording of known signals, without metrics."""
    decimation, experiment = master.scenario.record.decimation, master.scenario.experiment
    return Result(
        run=about(master, seeds, recording),
        times=np.array([experiment.time(row * decimation) for row in range(recording.rows)]),
        signals=dict(zip(known, recording.data[: recording.rows].T.copy())),
        about={name: Signal(v.unit or "", v.nominal, v.causality) for name, v in known.items()},
        parameters=recording.parameters,
        timing=dict(zip(master.order.names, map(Timing, recording.seconds, recording.calls))),
        wall=recording.wall,
        interrupted=recording.interrupted,
        messages=tuple(recording.messages),
    )


def about(master: Master, seeds: Mapping[str, int], recording: Recording) -> Run:
    """What was run and how."""
    scenario, experiment = master.scenario, master.scenario.experiment
    return Run(
        title=scenario.title,
        scenario=scenario.name,
        variant=scenario.variant,
        method=experiment.method,
        start=experiment.start,
        stop=experiment.stop,
        base_step=experiment.base_step,
        decimation=scenario.record.decimation,
        seeds=dict(seeds),
        components={name: component_facts(master, name) for name in scenario.components},
        order=master.order.names,
        delayed=tuple(str(connection) for connection in master.order.delayed),
        files=file_hashes(scenario),
        versions=versions(),
        overruns=recording.overruns,
        lag=recording.lag,
        figure=scenario.figure,
        source=str(scenario.path.resolve()),
    )


def file_hashes(scenario: Scenario) -> dict[str, str]:
    """Hash of each file of a scenario, by its path from the scenario's folder, and of what stands in none."""
    folder = scenario.path.parent.resolve()
    files = {Path(os.path.relpath(file.resolve(), folder)).as_posix(): sha256(file) for file in scenario.files}
    return {**files, **scenario.hashes}


def component_facts(master: Master, name: str) -> dict[str, Any]:
    """FMU and grid of a component."""
    component, description = master.scenario.components[name], master.descriptions[name]
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


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Turns Ctrl-C into a question the master asks between steps; a second Ctrl-C interrupts at once.

    A KeyboardInterrupt must not be raised inside a Python FMU, which runs in this very interpreter. Outside the main
    thread Python delivers no signals, and nothing is changed.
    """
    noted: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        if noted:
            raise KeyboardInterrupt
        noted.append(number)

    is_main = threading.current_thread() is threading.main_thread()
    previous = signal.signal(signal.SIGINT, note) if is_main else None
    try:
        yield lambda: bool(noted)
    finally:
        if previous is not None:
            signal.signal(signal.SIGINT, previous)
