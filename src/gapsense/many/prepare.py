"""From a study file to what can be run: the study, its scenario and FMUs, and the plan, with everything checked."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.files import SHOWN, fingerprint
from gapsense.cosim.check import check_scenario, find_fmus, read_descriptions, taken, unmatched
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.run.ahead import AUTO
from gapsense.cosim.run.engines import folder_of
from gapsense.cosim.scenario.fingerprint import deciding, facts
from gapsense.cosim.scenario.read import read_draft, scenario_file
from gapsense.cosim.scenario.records import Scenario, signals
from gapsense.many.columns import OWN, columns_of
from gapsense.many.plan import Plan
from gapsense.many.study import Study, read_study, scenario_beside
from gapsense.many.worker import Many, thrifty
from gapsense.problems import ScenarioError
from gapsense.tables import Value, read_toml

TRIES = 2  # of a run whose process dies: somebody may have ended it
NUMBERS = re.compile(r"[-+]?\d[-+.\de]*")


@dataclass(frozen=True)
class Prepared:
    """A study and what it runs; the plan has the combinations of the scenario's own `[sweep]` too."""

    study: Study
    many: Many  # of a scenario without a sweep, and without the inputs that are varied

    @property
    def facts(self) -> dict[str, str]:
        """Hashes of what decides the numbers, but for the number of seeds."""
        many, files = self.many, {str(file.resolve()): file for file in self.study.files}
        plan = [[[str(p), facts(hashable(c), files)] for p, c in block.columns.items()] for block in many.plan.blocks]
        return {
            "the scenario": fingerprint(deciding(many.scenario)),
            "the FMUs": fingerprint({name: d.sha256 for name, d in many.descriptions.items()}),
            "the values": fingerprint([plan, many.plan.is_common]),
            "the trajectories": fingerprint([self.study.signals, self.study.decimation]),
        }


def hashable(column: Sequence[Value] | npt.NDArray[Any]) -> Any:
    """A column whose bytes are its values, or a list of these."""
    return column if isinstance(column, np.ndarray) and column.dtype != object else list(column)


def check_study(study: str | Path, fmus: str | Path | None = None) -> list[str]:
    """Problems of a study file, its scenario and FMUs, found without running anything.

    Parameters
    ----------
    study : str or Path
        Study file.
    fmus : str or Path, optional
        Folder of the FMUs, as in `gapsense.run`.

    Returns
    -------
    list of str
        One sentence each with file, place, what was found, what was expected and what to do; empty if all is well.
    """
    return inspect(study, fmus)[0]


def prepare(study: str | Path, fmus: str | Path | None = None, engine: str = AUTO) -> Prepared:
    """What a study file says can be run; a ScenarioError has all problems of it, its scenario and the FMUs."""
    problems, prepared = inspect(study, fmus, engine)
    if problems or prepared is None:
        raise ScenarioError(problems)
    return prepared


def inspect(path: str | Path, fmus: str | Path | None, engine: str = AUTO) -> tuple[list[str], Prepared | None]:
    """Problems, and what could be prepared."""
    problems: list[str] = []
    study = read_study(path, problems)
    if study is None:
        return problems, None
    draft = read_draft(study.scenario, study.variant)
    problems += draft.problems
    if draft.scenario is None:
        return problems, None
    chosen = folder_of(engine, study.scenario, fmus)
    folder = find_fmus(scenario_file(study.scenario)) if chosen is None else Path(chosen)
    descriptions = read_descriptions(draft.scenario, folder, problems)
    read = taken(draft.scenario, descriptions)
    plan = study.plan.over(read)
    judged = judgeable(study, read, plan)
    problems += own_problems(study, read)
    problems += translated(check_scenario(judged, descriptions, draft.broken), study, read.path.name)
    if len(descriptions) == len(read.components):
        found = unmatched(study.signals, signals(descriptions), "trajectories.signals")
        problems += [f"{study.path.name}, {problem}" for problem in found]
    return problems, None if problems else Prepared(study, many_of(study, runnable(judged, study), descriptions, plan))


def many_of(study: Study, scenario: Scenario, descriptions: Descriptions, plan: Plan) -> Many:
    """The runs of a study."""
    return Many(
        scenario=scenario,
        descriptions=descriptions,
        plan=plan,
        columns=columns_of(scenario, descriptions, plan, study.signals),
        signals=study.signals,
        decimation=study.decimation,
        files=study.files,
        tries=TRIES,
    )


def scenario_of(study: str | Path) -> Path | None:
    """The file of the scenario that a study file names, if it names one."""
    name = (read_toml(Path(study), []) or {}).get("scenario") if Path(study).is_file() else None
    return scenario_file(scenario_beside(Path(study), name)) if isinstance(name, str) else None


def runnable(scenario: Scenario, study: Study) -> Scenario:
    """What the workers run: without a sweep, and recording only what metrics look at and what is kept."""
    spare = thrifty(replace(scenario, rows=(), rows_columns={}))
    names = tuple(dict.fromkeys((*spare.record.signals, *study.signals)))
    return replace(spare, record=replace(spare.record, signals=names))


def judgeable(study: Study, scenario: Scenario, plan: Plan) -> Scenario:
    """The scenario with telling points of the plan as its sweep."""
    numbers = plan.telling() if plan.ports else []
    inputs = {port: value for port, value in scenario.inputs.items() if port not in study.places}
    columns = {**scenario.rows_columns, **study.columns}
    block = {port: k for k, block in enumerate(plan.blocks) for port in block.columns}
    rows = [plan.rows(number) for number in numbers]
    lines = {port: tuple(column.lines[row[block[port]]] for row in rows) for port, column in columns.items()}
    told = {port: column._replace(lines=lines[port]) for port, column in columns.items()}
    return replace(scenario, inputs=inputs, grid={}, rows=tuple(map(plan.point, numbers)), rows_columns=told)


def own_problems(study: Study, scenario: Scenario) -> list[str]:
    """What does not fit together, whatever the FMUs."""
    name, problems = study.path.name, []
    for port, place in study.places.items():
        if port in scenario.swept:
            problems.append(f"{name}, {place}: the scenario's `[sweep]` gives `{port}` too. Keep one.")
    if not scenario.seeds and study.plan.seeds > 1:
        problems.append(
            f"{name}, seeds: {study.plan.seeds} runs of each point would be the same. Add `[seeds]` to the scenario."
        )
    for metric in scenario.metrics:
        if metric.name in OWN:
            problems.append(
                f"{scenario.path.name}, metrics.{metric.name}: a result has a column of that name. Rename it."
            )
    if not scenario.metrics and not study.signals:
        problems.append(
            f"{name}: nothing of the runs would be kept. Add `[metrics]` to the scenario or `[trajectories]`."
        )
    return problems


def translated(found: Iterable[str], study: Study, file: str) -> list[str]:
    """Problems of the scenario, at the place of the study file where that gives the value; of many alike the first."""
    told: dict[str, list[str]] = {}
    for problem in (renamed(problem, study, file) for problem in found):
        told.setdefault(NUMBERS.sub("", problem), []).append(problem)
    return [problem for alike in told.values() for problem in few(alike)]


def renamed(problem: str, study: Study, file: str) -> str:
    """A problem with the place in the study file, if that gives the value."""
    for port, place in study.places.items():
        for end in (":", " ("):
            head = f"{file}, sweep.{port}{end}"
            if problem.startswith(head):
                name = "" if place.endswith(str(port)) else f", `{port}`"
                return f"{study.path.name}, {place}{name}{end}{problem[len(head) :]}"
    return problem


def few(alike: list[str]) -> list[str]:
    """The first of some sentences that differ in numbers, and how many more there are."""
    left = len(alike) - SHOWN
    return alike[:SHOWN] + ([f"{alike[0].partition(': ')[0]}: {left} more values are wrong."] if left > 0 else [])
