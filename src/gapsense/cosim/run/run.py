"""Run a scenario: from its file to a result, here or in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gapsense._os.interrupts import count_interrupts
from gapsense.cosim.check import prepare
from gapsense.cosim.run.ahead import run_ahead
from gapsense.cosim.run.apart import Listeners, Plan, record_apart, tell
from gapsense.cosim.run.checkpoint import Checkpoint, Keeper, keeper
from gapsense.cosim.run.recording import STOP, Subject, finish_recording
from gapsense.cosim.scenario.read import Source
from gapsense.cosim.scenario.records import ISOLATIONS, Port, Scenario
from gapsense.problems import suggest
from gapsense.tables import Value

if TYPE_CHECKING:
    from gapsense.cosim.fmu.descriptions import Description
    from gapsense.cosim.result.result import Result
    from gapsense.cosim.run.master import Master, Progress


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
    with run_ahead() if isolation == "process" else nullcontext():
        read, descriptions = prepare(scenario, variant, fmus)
        read = set_isolation(read, isolation, step_limit)
        return run_prepared(read, descriptions, seed_shift, progress, point, checkpoint, notice)


def run_prepared(
    scenario: Scenario,
    descriptions: dict[str, Description],
    seed_shift: int = 0,
    progress: Progress | None = None,
    point: int | None = None,
    checkpoint: Checkpoint | None = None,
    notice: Callable[[str], None] = tell,
) -> Result:
    """Run a scenario that was read and checked, as `run` does."""
    subject = Subject(scenario, descriptions)
    take = subject.make_take(seed_shift, point)
    kept = keeper(checkpoint, scenario, descriptions, take) if checkpoint else None
    if scenario.experiment.isolation == "process":
        watch = Listeners(progress, notice, meanwhile=lambda: subject.run)
        return finish_recording(subject, take, record_apart(Plan(scenario, descriptions, take, kept), watch))
    from gapsense.cosim.run.master import Master  # here: a run in another process does not need it

    with Master(scenario, descriptions) as master:
        return run_once(master, seed_shift, progress, point, kept)


def set_isolation(scenario: Scenario, isolation: str | None, step_limit: float | None) -> Scenario:
    """Give a scenario another isolation and limit, where they are given."""
    experiment = scenario.experiment
    isolation, limit = isolation or experiment.isolation, step_limit or experiment.step_limit
    if isolation not in ISOLATIONS:
        raise ValueError(f"`isolation` is {isolation!r}. {suggest(isolation, ISOLATIONS)}")
    return replace(scenario, experiment=replace(experiment, isolation=isolation, step_limit=limit))


def run_once(
    master: Master,
    seed_shift: int = 0,
    progress: Progress | None = None,
    point: int | Mapping[Port, Value] | None = None,
    kept: Keeper | None = None,
) -> Result:
    """One run of a loaded scenario; raises FmuError with the partial result if a component fails.

    A KeyboardInterrupt must not be raised inside a Python FMU, which runs in this very interpreter: the first Ctrl-C
    is asked for between steps.  After the second one whatever fails does so because of it.
    """
    take = master.subject.make_take(seed_shift, point)
    master.marks[STOP] = 0
    with count_interrupts(at_most=1, then=master.stop) as interrupts:
        recording = master.run(take.columns, take.seeds, progress, take.values, keeper=kept)
        if interrupts() > 1:
            recording.error, recording.interrupted = None, True
    return finish_recording(master.subject, take, recording)
