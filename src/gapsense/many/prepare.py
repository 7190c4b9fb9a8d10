"""From a study file to what can be run: the study, its scenario and FMUs, and the plan, with everything checked."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import SHOWN, fingerprint
from gapsense.cosim.check import check_patterns, check_scenario, find_fmus, keep_own_values, read_descriptions
from gapsense.cosim.run.ahead import AUTO
from gapsense.cosim.run.engines import folder_of
from gapsense.cosim.scenario.fingerprint import deciding, facts
from gapsense.cosim.scenario.read import STUDY, other_kind, read_draft, read_lists, read_rows, scenario_file, split
from gapsense.cosim.scenario.records import (
    MOST_RUNS,
    SECTION,
    Block,
    Plan,
    Port,
    RowsColumn,
    Scenario,
    product,
    signals,
)
from gapsense.many.columns import OWN, columns_of
from gapsense.many.draws import DISTRIBUTIONS, points
from gapsense.many.keys import SECTIONS
from gapsense.many.worker import Many, thrifty
from gapsense.parameters import is_file, locate_file
from gapsense.problems import ScenarioError
from gapsense.shipped import example
from gapsense.tables import TABLES, Table, read_toml


@dataclass(frozen=True)
class Study:
    """What a study file says; `places` tells where in it each parameter is given, `columns` those of its rows."""

    path: Path
    title: str
    description: str
    scenario: Path
    variant: str | None
    plan: Plan
    places: Mapping[Port, str]
    columns: Mapping[Port, RowsColumn]
    signals: tuple[str, ...]  # patterns of the trajectories that are kept
    decimation: int  # of their rows
    files: tuple[Path, ...]  # that its values name


def read_study(path: str | Path, problems: list[str]) -> Study | None:
    """Study of a file as far as it can be read, or None."""
    path = Path(path)
    if wrong := other_kind(path, STUDY):
        problems.append(wrong)
        return None
    data = read_toml(path, problems)
    return None if data is None else StudyReader(path, data, problems).study()


def scenario_beside(study: Path, name: str) -> Path:
    """The scenario that a study file names; an example counts where there is no such file."""
    beside = study.parent / name
    return Path(name) if not beside.exists() and example(name) else beside


class StudyReader:
    """Reads one study; `places` fills with where each parameter is given."""

    def __init__(self, path: Path, data: Mapping[str, Any], problems: list[str]) -> None:
        self.path, self.folder, self.table = path, path.parent, Table(data, path.name, "", problems)
        self.places: dict[Port, str] = {}
        self.columns: dict[Port, RowsColumn] = {}
        self.files: list[Path] = []

    def study(self) -> Study | None:
        """The study, or None if there is no scenario to hold it against."""
        own = self.table.read(SECTIONS["study"])
        blocks = (*self.rows(own["rows"]), *self.sample(), *self.grid(), *self.ranges())
        plan = Plan(blocks, own["seeds"], own["noise"] == "common")
        if plan.points * plan.seeds > MOST_RUNS:
            found = product((*(block.size for block in blocks), plan.seeds))
            self.table.note("", f"{found} runs found, at most {MOST_RUNS} expected. Shorten something.")
        kept = self.table.table("trajectories")
        signals = kept.read(SECTIONS["trajectories"]) if "trajectories" in self.table.data else {}
        return own["scenario"] and Study(
            path=self.path,
            title=own["title"] or "",
            description=own["description"],
            scenario=scenario_beside(self.path, own["scenario"]),
            variant=own["variant"],
            plan=plan,
            places=self.places,
            columns=self.columns,
            signals=tuple(signals.get("signals") or ()),
            decimation=signals.get("decimation") or 1,
            files=tuple(dict.fromkeys(self.files)),
        )

    def components(self) -> set[str]:
        """Names of the components of the scenario, if it can be read, and of what else has parameters."""
        name = self.table.data.get("scenario")
        data = read_toml(scenario_file(scenario_beside(self.path, name)), []) if isinstance(name, str) else None
        found = (data or {}).get("components")
        return {SECTION, *(found if isinstance(found, dict) else ())}

    def give_once(self, place: str, columns: Mapping[Port, Any]) -> Iterator[Block]:
        """A block of those parameters that are given nowhere else."""
        for port in columns:
            if port in self.places:
                self.table.note(place, f"`{port}` is given in `{self.places[port]}` too. Keep one.")
        fresh = {port: values for port, values in columns.items() if port not in self.places}
        self.places.update(dict.fromkeys(fresh, place))
        if fresh:
            yield Block(fresh)

    def rows(self, file: str | None) -> Iterator[Block]:
        """Values that belong together, of a CSV file."""
        if file is None:
            return
        self.files.append(self.folder / file)
        table = Table({}, self.path.name, "", self.table.problems)
        rows, self.columns = read_rows(self.folder / file, table, self.files, self.components())
        if rows:
            yield from self.give_once("rows", {port: [row[port] for row in rows] for port in rows[0]})

    def grid(self) -> Iterator[Block]:
        """Lists, each a block of its own."""
        grid = self.table.table("grid")
        for port, values in read_lists(grid, self.folder, self.files).items():
            yield from self.give_once(grid.at(str(port)), {port: values})

    def ranges(self) -> Iterator[Block]:
        """Values at even distances, each range a block of its own."""
        for k, item in enumerate(self.table.take("ranges", TABLES, [])):
            table = self.table.child(item, f"ranges[{k}]")
            own = table.read(SECTIONS["range"])
            port = own["parameter"] and split(table, "parameter", own["parameter"])
            if port and is_range(table, own):
                yield from self.give_once(table.at("parameter"), {port: space_values(own)})

    def sample(self) -> Iterator[Block]:
        """Values that are drawn, all in one block."""
        if "sample" not in self.table.data:
            return
        table = self.table.table("sample")
        own, items = table.read(SECTIONS["sample"]), table.take("factors", TABLES, required=True)
        tables = [table.child(item, f"factors[{k}]") for k, item in enumerate(items or ())]
        if items == []:
            table.note("factors", "there is none. Add a table `[[sample.factors]]`.")
        factors, count = [factor for factor in map(read_factor, tables) if factor], own["count"]
        if own["method"] == "sobol" and count and count & (count - 1):
            below = 1 << (count.bit_length() - 1)
            table.note("count", f"{count} found, a power of 2 expected for Sobol: {below} or {2 * below}. Choose one.")
        elif count and count > MOST_RUNS:
            table.note("count", f"{count} found, at most {MOST_RUNS} are allowed. Correct it.")
        elif count and factors and len(factors) == len(tables):
            drawn = points(own["method"], count, len(factors), own["seed"])
            yield from self.draw(factors, drawn)

    def draw(self, factors: list[tuple[Table, Port, Mapping[str, Any]]], drawn: Any) -> Iterator[Block]:
        """The block of what is drawn."""
        columns = {}
        for (table, port, own), u in zip(factors, drawn.T):
            if port in columns:
                table.note("parameter", f"`{port}` is drawn twice. Keep one.")
            given = [locate_file(str(port), value, self.folder, table) for value in own["values"] or ()]
            self.files += [Path(str(value)) for value in given if is_file(str(port), value)]
            columns[port] = DISTRIBUTIONS[own["distribution"]].quantile(u, {**own, "values": given})
        yield from self.give_once("sample.factors", columns)


def read_factor(table: Table) -> tuple[Table, Port, Mapping[str, Any]] | None:
    """What one factor says, or None after noting what is wrong with it."""
    before, own = len(table.problems), table.read(SECTIONS["factor"])
    port = own["parameter"] and split(table, "parameter", own["parameter"])
    if own["distribution"] is None:
        return None
    kind = DISTRIBUTIONS[own["distribution"]]
    for key in ("low", "high", "mean", "std", "median", "sigma", "values"):
        if key in kind.needs and key not in table.data:
            table.note(key, f"missing; `{own['distribution']}` needs it. Add it.")
        elif key not in (*kind.needs, *kind.takes) and key in table.data:
            table.note(key, f"`{own['distribution']}` does not use it. Remove it.")
    if len(table.problems) > before or not port:
        return None
    if problem := kind.problem(own):
        table.note("", problem)
        return None
    return table, port, own


def is_range(table: Table, own: Mapping[str, Any]) -> bool:
    """True if a range can be gone through."""
    first, last, count = own["from"], own["to"], own["count"]
    if first is None or last is None or count is None:
        return False
    if count < 2 or first == last:
        table.note("", f"{count} values from {first:.9g} to {last:.9g}: at least two different ones are expected.")
    elif own["spacing"] == "log" and not first * last > 0:
        table.note("", f"even ratios from {first:.9g} to {last:.9g} do not exist. Let both be positive.")
    elif count > MOST_RUNS:
        table.note("count", f"{count} found, at most {MOST_RUNS} are allowed. Correct it.")
    else:
        return True
    return False


def space_values(own: Mapping[str, Any]) -> list[Any]:
    """Space the values of a range; they are whole numbers where these are meant."""
    first, last, count = own["from"], own["to"], own["count"]
    if own["spacing"] == "log":
        return list(np.geomspace(first, last, count).tolist())
    if isinstance(first, int) and isinstance(last, int) and (last - first) % (count - 1) == 0:
        step = (last - first) // (count - 1)
        return [first + k * step for k in range(count)]
    return list(np.linspace(first, last, count).tolist())


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


def hashable(column: Any) -> Any:
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
    if (study := read_study(path, problems)) is None:
        return problems, None
    draft = read_draft(study.scenario, study.variant)
    problems += draft.problems
    if draft.scenario is None:
        return problems, None
    chosen = folder_of(engine, study.scenario, fmus)
    folder = find_fmus(scenario_file(study.scenario)) if chosen is None else Path(chosen)
    descriptions = read_descriptions(draft.scenario, folder, problems)
    read = keep_own_values(draft.scenario, descriptions)
    plan = replace(study.plan, blocks=(*read.plan.blocks, *study.plan.blocks))  # the scenario's own sweep comes first
    judged = judgeable(study, read, plan)
    problems += own_problems(study, read)
    problems += translate_problems(check_scenario(judged, descriptions, draft.broken), study, read.path.name)
    if len(descriptions) == len(read.components):
        found = check_patterns(study.signals, signals(descriptions), "trajectories.signals")
        problems += [f"{study.path.name}, {problem}" for problem in found]
    if problems:
        return problems, None
    scenario = runnable(judged, study)
    many = Many(
        scenario=scenario,
        descriptions=descriptions,
        plan=plan,
        columns=columns_of(scenario, descriptions, plan, study.signals),
        signals=study.signals,
        decimation=study.decimation,
        files=study.files,
        tries=TRIES,
    )
    return [], Prepared(study, many)


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
    name, twice = study.path.name, [(port, place) for port, place in study.places.items() if port in scenario.swept]
    problems = [f"{name}, {place}: the scenario's `[sweep]` gives `{port}` too. Keep one." for port, place in twice]
    if not scenario.seeds and study.plan.seeds > 1:
        problems.append(
            f"{name}, seeds: {study.plan.seeds} runs of each point would be the same. Add `[seeds]` to the scenario."
        )
    for taken in (metric.name for metric in scenario.metrics if metric.name in OWN):
        problems.append(f"{scenario.path.name}, metrics.{taken}: a result has a column of that name. Rename it.")
    if not scenario.metrics and not study.signals:
        problems.append(
            f"{name}: nothing of the runs would be kept. Add `[metrics]` to the scenario or `[trajectories]`."
        )
    return problems


def translate_problems(found: Iterable[str], study: Study, file: str) -> list[str]:
    """Move problems of the scenario to the place in the study file that gives the value; keep the first of many."""
    told: dict[str, list[str]] = {}
    for problem in (rename_problem(problem, study, file) for problem in found):
        told.setdefault(NUMBERS.sub("", problem), []).append(problem)
    for alike in told.values():
        if (left := len(alike) - SHOWN) > 0:
            alike[SHOWN:] = [f"{alike[0].partition(': ')[0]}: {left} more values are wrong."]
    return [problem for alike in told.values() for problem in alike]


def rename_problem(problem: str, study: Study, file: str) -> str:
    """Give a problem its place in the study file, if that gives the value."""
    for port, place in study.places.items():
        for end in (":", " ("):
            head = f"{file}, sweep.{port}{end}"
            if problem.startswith(head):
                name = "" if place.endswith(str(port)) else f", `{port}`"
                return f"{study.path.name}, {place}{name}{end}{problem[len(head) :]}"
    return problem
