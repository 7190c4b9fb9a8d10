"""Whether a scenario can be run: it is read, and held against the model descriptions of its FMUs; nothing is loaded."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import gcd, lcm, prod
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gapsense._os.files import facts_beside, fingerprint, is_sealed, read_columns, remember
from gapsense.cosim.fmu.archive import UnusableError, read_description
from gapsense.cosim.fmu.descriptions import (
    NUMERIC,
    Description,
    Descriptions,
    Variable,
    broken_rules,
    describe,
    find_fmu,
    mend_description,
)
from gapsense.cosim.fmu.line import absent, wrong_board
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.read import Source, load, read_draft, scenario_file, vary_events
from gapsense.cosim.scenario.records import (
    ACTIONS,
    MOST_STEPS,
    SECTION,
    SLACK,
    Component,
    Connection,
    Event,
    Experiment,
    FeedthroughCycleError,
    Metric,
    Plan,
    Played,
    Port,
    RowsColumn,
    Scenario,
    blocks,
    execution_order,
    find_reached,
    index_of,
    is_on_grid,
    matching,
    neighbours,
    recorded_signals,
    resolve_targets,
    signals,
)
from gapsense.parameters import core_problem, is_file
from gapsense.problems import ScenarioError, format_limits, listing, suggest
from gapsense.shipped import FMU_FOLDER, NATIVE_FOLDER, ROOT
from gapsense.tables import Value, describe_value, is_integer, is_number


def check(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> list[str]:
    """Problems of a scenario, found without running it.

    Parameters
    ----------
    scenario : str, Path or Document
        Scenario file, its folder, or its content.
    variant : str, optional
        Variant to check; by default the scenario as it is and then every variant, which may have boards whose firmware
        is still to be built.
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
            more = [f"variant {name}: {p}" for p in inspect(scenario, name, fmus, False)[0] if p not in problems]
            problems = problems + more
    return problems


def remarks(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> list[str]:
    """Sentences on what falls between the steps of a scenario without problems, as in `check`; it can be run."""
    sources = [variant] if variant else [None, *load(scenario).variants]
    found = {name: on_grid(*prepare(scenario, name, fmus, bool(variant))) for name in sources}
    base = found[sources[0]]
    more = (f"variant {name}: {said}" for name, own in found.items() for said in own if name and said not in base)
    return base if variant else [*base, *more]


def prepare(
    scenario: Source, variant: str | None = None, fmus: str | Path | None = None, to_run: bool = True
) -> tuple[Scenario, dict[str, Description]]:
    """Scenario and model descriptions, checked; raises ScenarioError with all problems of both."""
    problems, read, descriptions = inspect(scenario, variant, fmus, to_run)
    if problems or read is None:
        raise ScenarioError(problems)
    return read, descriptions


def inspect(
    scenario: Source, variant: str | None, fmus: str | Path | None, to_run: bool = True
) -> tuple[list[str], Scenario | None, dict[str, Description]]:
    """Problems of file and FMUs together, the scenario as far as it could be read, and the model descriptions.

    What is `to_run` needs the firmware of its boards.
    """
    draft = read_draft(scenario, variant)
    if draft.scenario is None:
        return draft.problems, None, {}
    problems = list(draft.problems)
    folder = Path(fmus) if fmus is not None else find_fmus(scenario_file(scenario))
    descriptions = read_descriptions(draft.scenario, folder, problems)
    read = keep_own_values(draft.scenario, descriptions)
    problems += check_scenario(read, descriptions, draft.broken)
    on_boards = {name: c for name, c in read.components.items() if c.board} if to_run else {}
    for name, component in on_boards.items():
        if problem := absent(component.board, component.firmware):
            problems.append(f"{read.path.name}, components.{name}.{problem}")
    return problems, read, descriptions


def find_fmus(scenario: Path, name: Path = FMU_FOLDER) -> Path:
    """Folder `build/fmus` in a folder above the scenario, or below the working directory, or else what was shipped."""
    above = (folder / name for folder in scenario.resolve().parents)
    return next((folder for folder in (*above, name, ROOT / name) if folder.is_dir()), name)


# Hold a scenario against the model descriptions of its FMUs; nothing is loaded or run.


WHOLE = ("Integer", "Boolean", "Enumeration")
TAKES: Mapping[str, Callable[[Value], bool]] = {  # which TOML values a type of FMI takes
    **dict.fromkeys(("Integer", "Enumeration"), is_integer),
    "Real": is_number,
    "String": lambda value: isinstance(value, str),
    "Boolean": lambda value: isinstance(value, bool),
}
AS_NUMBERS = ("Boolean", "Integer")  # types of which a Real input takes the number; true is 1
MOST_POINTS = 10**6  # of a sweep
T = TypeVar("T")
OWN = "Build the FMUs with `gapsense build%s`."  # remedies for an FMU that is missing
FOREIGN = "Correct the path; it is relative to the scenario."


def read_descriptions(scenario: Scenario, fmus: Path, problems: list[str]) -> dict[str, Description]:
    """Model description of each component whose FMU can be read; each FMU file is read once."""
    known: dict[Path, Description | None] = {}
    out = {}
    own = OWN % (" --native" if NATIVE_FOLDER.name in fmus.parts[-2:] else "")
    for name, component in scenario.components.items():
        if not component.fmu:  # which reading has told
            continue
        path = find_fmu(component.fmu, scenario.path, fmus)
        remedy = FOREIGN if component.fmu.endswith(".fmu") else own
        if path not in known:
            known[path] = description_at(path, f"{scenario.path.name}, components.{name}.fmu", remedy, problems)
        description = known[path]
        if description is not None:
            out[name] = resize_arrays(description, component, problems)
    return out


def resize_arrays(description: Description, component: Component, problems: list[str]) -> Description:
    """Give the arrays of a description the sizes that a component sets."""
    structural = [v for v in description.variables.values() if v.is_structural]
    given = {v.name: component.values[v.name] for v in structural if v.name in component.values}
    sizes = {name: int(value) for name, value in given.items() if is_integer(value) and int(value) >= 0}
    try:
        return describe_fmu(description.path, tuple(sizes.items())) if sizes else description
    except UnusableError as error:
        problems.append(f"components.{component.name}: `{description.path}` cannot be used like this: {error}")
        return description


def description_at(path: Path, place: str, remedy: str, problems: list[str]) -> Description | None:
    """Model description of an FMU, or None after noting why there is none."""
    if not path.is_file():
        present = sorted(file.stem for file in path.parent.glob("*.fmu"))
        hint = suggest(path.stem, present) if present else "That folder has no FMU."
        problems.append(f"{place}: there is no FMU `{path}`. {hint} {remedy}")
        return None
    try:
        return describe_fmu(path)
    except UnusableError as error:
        problems.append(f"{place}: `{path}` cannot be used: {error}")
        return None


@remember
def describe_fmu(path: Path, sizes: tuple[tuple[str, int], ...] = ()) -> Description:
    """Read the model description of an FMU file, with arrays of some sizes."""
    return describe(path, dict(sizes))


def check_scenario(scenario: Scenario, descriptions: Descriptions, broken: frozenset[str] = frozenset()) -> list[str]:
    """Everything in a scenario that does not fit the FMUs, each with file and place.

    Components without a description are left out; the gaps of sections that are `broken`, that is could not be read
    completely, are no problems of their own.
    """
    problems = list(dict.fromkeys(Checker(scenario, descriptions, broken).problems()))
    is_complete = len(descriptions) == len(scenario.components)
    if is_complete and not broken & {"record", "components"}:
        found = check_record(scenario, descriptions, "experiment" not in broken)
        problems += [f"{scenario.path.name}, {problem}" for problem in found]
    return problems


def own_points(scenario: Scenario, component: str) -> Iterator[dict[str, Value]]:
    """Combinations of the values that a sweep gives a component, telling ones if there are many; one without any."""

    def own(values: Mapping[Port, T]) -> dict[Port, T]:
        return {port: value for port, value in values.items() if port.component == component}

    rows = dict.fromkeys(tuple(own(row).items()) for row in scenario.rows)
    plan = Plan(blocks([*map(dict, rows)], own(scenario.grid)))
    for number in plan.telling():
        yield {port.variable: value for port, value in plan.point(number).items()}


class Checker:
    """The checks of one scenario; each yields its problems."""

    def __init__(self, scenario: Scenario, descriptions: Descriptions, broken: frozenset[str]) -> None:
        self.scenario, self.descriptions, self.broken = scenario, descriptions, broken

    def problems(self) -> Iterator[str]:
        """All problems, in the order of the file."""
        sets = check_sets(self.scenario.components, self.descriptions)
        wiring = (self.connections(), self.inputs(), self.check_drivers(), self.loops(), self.control())
        values = (self.values(), self.rules(), *wiring, self.events(), self.seeds(), self.grid())
        for problem in chain(self.singles(), self.boards(), sets, *values):
            yield f"{self.scenario.path.name}, {problem}"

    def singles(self) -> Iterator[str]:
        """No second instance in one process of an FMU that can have only one per process."""
        first: dict[Path, str] = {}
        for name, description in self.descriptions.items():
            if self.scenario.components[name].isolation == "process":
                continue
            other = first.setdefault(description.path, name)
            if description.is_single and other != name:
                remedy = f'Give `components.{name}` a process of its own: `isolation = "process"`.'
                yield f"components.{name}.fmu: `{other}` uses it too, and a process can hold only one. {remedy}"

    def boards(self) -> Iterator[str]:
        """Boards: of a known kind, with a firmware where one is needed; a board has each of its components once."""
        there: dict[tuple[str, str], str] = {}
        for name, component in self.scenario.components.items():
            problem = wrong_board(component.board, component.firmware) if component.board else ""
            if component.firmware and not component.board:
                problem = "firmware: it is for a `board`, which is missing. Add one."
            if component.board and component.isolation == "process":
                problem = "isolation: a board is apart already. Leave it out."
            other = there.setdefault((component.board, component.fmu), name)
            if component.board and other != name:
                problem = f"board: `{other}` is on it with the same FMU. Give one of them another board."
            if problem:
                yield f"components.{name}.{problem}"

    def values(self) -> Iterator[str]:
        """Parameters: known, of the right type, within their limits; steps that fit the sample time."""
        for name, description in self.descriptions.items():
            component = self.scenario.components[name]
            yield from check_values(component, description)
            if "experiment" not in self.broken:
                yield from check_grid(component, description, self.scenario.experiment)

    def rules(self) -> Iterator[str]:
        """Parameters: what an FMU states beyond FMI, also for the combinations of a sweep."""
        for name, description in self.descriptions.items():
            values = self.scenario.components[name].values
            for swept in own_points(self.scenario, name):
                place = f"sweep, components.{name}" if swept else f"components.{name}"
                given = {n: v for n, v in {**values, **swept}.items() if not value_problem(n, v, description)}
                problems = [] if description.rules is None else broken_rules(description.rules, given)
                yield from (f"{place}: {problem.rstrip('.')}. Correct the parameters." for problem in problems)

    def seeds(self) -> Iterator[str]:
        """Seeds: of components that have one, stated once."""
        for name, seed in self.scenario.seeds.items():
            if name not in self.scenario.components:
                yield f"seeds.{name}: {no_component(name, self.scenario)}"
            elif name in self.descriptions:
                yield from check_seed(self.scenario.components[name], self.descriptions[name], seed)

    def grid(self) -> Iterator[str]:
        """Values of a sweep: not too many, of known parameters, of the right type and in their limits, no seeds."""
        lengths = [len(self.scenario.rows) or 1, *map(len, self.scenario.grid.values())]
        if prod(lengths) > MOST_POINTS:
            found = f"{' x '.join(map(str, lengths))} values make {prod(lengths):.9g} combinations"
            yield f"sweep: {found}, at most {MOST_POINTS} are allowed. Shorten a list."
        for port, values in self.scenario.swept.items():
            if port.component == SECTION and SECTION not in self.scenario.components:
                continue  # it varies a key of an event
            if port.component not in self.scenario.components:
                yield f"sweep.{port}: {no_component(port.component, self.scenario)}"
            elif port.variable == "seed" and port.component in self.scenario.seeds:
                yield f"sweep.{port}: the seed is also given in `seeds.{port.component}`. Keep one."
            elif port.component in self.descriptions:
                component, description = self.scenario.components[port.component], self.descriptions[port.component]
                column = self.scenario.rows_columns.get(port)
                yield from check_swept(component, description, port.variable, values, self.scenario.experiment, column)

    def events(self) -> Iterator[str]:
        """Events: targets, values, conditions and times, also for the combinations of a sweep."""
        knows_times = "experiment" not in self.broken
        yield from check_events(self.scenario, self.descriptions, self.scenario.events, SECTION, knows_times)
        for swept in own_points(self.scenario, SECTION):
            if swept:
                problems: list[str] = []
                events = vary_events(self.scenario.events, {Port(SECTION, n): v for n, v in swept.items()}, problems)
                place = f"sweep, {SECTION}"
                yield from problems or check_events(self.scenario, self.descriptions, events, place, knows_times)

    def resolve(self, port: Port, causality: str, place: str) -> Iterator[str]:
        """Problems of a port that must be an input or output of a component."""
        if port.component not in self.scenario.components:
            yield f"{place}: {no_component(port.component, self.scenario)}"
            return
        if port.component not in self.descriptions:
            return
        variables = self.descriptions[port.component].variables
        known = [v.name for v in variables.values() if v.causality == causality]
        variable = variables.get(port.variable)
        if variable is None:
            yield f"{place}: unknown variable `{port.variable}` in `{port.component}`. {suggest(port.variable, known)}"
        elif variable.causality != causality:
            a = "an" if variable.causality[0] in "aeiou" else "a"
            yield f"{place}: `{port}` is {a} {variable.causality}, an {causality} is expected. Correct the name."

    def variable(self, port: Port) -> Variable | None:
        """The variable of a port, or None where it is unknown."""
        description = self.descriptions.get(port.component)
        return description.variables.get(port.variable) if description else None

    def connections(self) -> Iterator[str]:
        """Both ends known, of types that fit, and of the same unit unless the connection converts."""
        for connection in self.scenario.connections:
            is_long = connection.place.endswith("]")
            yield from self.resolve(connection.source, "output", connection.place + ".from" * is_long)
            yield from self.resolve(connection.target, "input", connection.place + ".to" * is_long)
            source, target = self.variable(connection.source), self.variable(connection.target)
            if source is not None and target is not None:
                yield from check_types(connection, source, target)
                yield from check_units(connection, source, target)

    def inputs(self) -> Iterator[str]:
        """Inputs known, their constants and signals of the right type and within their limits."""
        for port, given in (*self.scenario.inputs.items(), *self.scenario.played.items()):
            yield from self.resolve(port, "input", f"inputs.{port}")
            problems: list[str | None] = []
            if variable := self.variable(port):
                problems += check_signal(given, variable) if isinstance(given, Played) else [misfit(given, variable)]
            if isinstance(given, Played) and "experiment" not in self.broken:
                problems += check_span(given, self.scenario.experiment)
            yield from (f"inputs.{port}: {problem}" for problem in problems if problem)

    def check_drivers(self) -> Iterator[str]:
        """Check that every input is driven exactly once."""
        drivers: dict[Port, list[str]] = {}
        for connection in self.scenario.connections:
            drivers.setdefault(connection.target, []).append(connection.place)
        for port in (*self.scenario.inputs, *self.scenario.played):
            drivers.setdefault(port, []).append(f"inputs.{port}")
        for name, description in self.descriptions.items():
            given = self.scenario.components[name].values
            for port in (Port(name, variable.name) for variable in description.of("input")):
                if port.variable in given:
                    drivers.setdefault(port, []).append(f"components.{name}.set")
                elif port in self.scenario.swept:
                    drivers.setdefault(port, []).append(f"sweep.{port}")
        for port, places in drivers.items():
            if len(places) > 1:
                yield f"{places[-1]}: `{port}` is driven {len(places)} times, by {', '.join(places)}. Keep one."
        if not self.broken & {"connections", "inputs"}:
            yield from self.idle(drivers)

    def idle(self, drivers: Mapping[Port, list[str]]) -> Iterator[str]:
        """Inputs that nothing drives."""
        for name, description in self.descriptions.items():
            for variable in description.of("input"):
                port = Port(name, variable.name)
                if port not in drivers:
                    start = "" if variable.start is None else f" (its start value is {variable.start})"
                    yield f"components.{name}: nothing drives `{port}`. Connect it or list it in `[inputs]`{start}."

    def loops(self) -> Iterator[str]:
        """No loop of direct feedthrough, or one of components that can repeat their steps."""
        known = [c for c in self.scenario.connections if self.variable(c.source) and self.variable(c.target)]
        try:
            names = [name for name in self.scenario.components if name in self.descriptions]
            order = execution_order(names, known, self.descriptions, self.scenario.experiment.method)
        except FeedthroughCycleError as error:
            yield f"connections: {error}"
            return
        loops = [name for loop in order.loops for name in loop]
        for name, component in self.scenario.components.items():
            variable = self.variable(Port(name, component.edge)) if component.edge else None
            if component.edge and not (variable and variable.causality == "output" and variable.type == "Real"):
                yield f"components.{name}.edge: `{component.edge}` is no Real output of it. Name one."
            elif component.edge and name not in loops:
                yield (
                    f'components.{name}.edge: it is in no loop that is iterated. Write `method = "iterative"` in '
                    "`[experiment]`, or leave `edge` out."
                )
            elif component.edge and len({self.scenario.components[n].step for n in loops}) > 1:
                yield f"components.{name}.edge: components of its loop differ in `step`. Give all the same."
        for name in (name for name in loops if self.scenario.components[name].board):
            yield (
                f"components.{name}.board: a board is in a loop, which `iterative` repeats from saved states; that"
                " needs FMUs. Take it out of the loop with `delayed = true` in `[[connections]]`, or run its FMU."
            )
        for name in (name for name in loops if not self.descriptions[name].can_return):
            yield (
                f"components.{name}.fmu: `{self.descriptions[name].path.name}` cannot save its state "
                "(canGetAndSetFMUstate), and it is in a loop, which `iterative` repeats from saved states. Export it "
                "with that, or take it out of the loop with `delayed = true` in `[[connections]]`."
            )

    def control(self) -> Iterator[str]:
        """Steps can be controlled: every component can go back, and pairs of steps fit between instants and rows."""
        components, experiment, where = self.scenario.components, self.scenario.experiment, "experiment.step_control"
        if experiment.step_control is None:
            return
        shortest = experiment.shortest_step
        pair = f"two steps of `shortest_step` = {shortest} have to fit between"
        for name, description in self.descriptions.items():
            if components[name].board or not description.can_return:
                what = "a board" if components[name].board else f"`{description.path.name}`"
                yield (
                    f"components.{name}: {what} cannot save its state (canGetAndSetFMUstate), and `step_control` "
                    "repeats steps. Leave out `step_control`, or the component."
                )
            elif components[name].step < 2 * shortest and not is_free(components[name], description):
                yield (
                    f"components.{name}: it keeps its instants, as it is sampled or cannot step otherwise "
                    f"(canHandleVariableCommunicationStepSize), and {pair} them: `step` is {components[name].step}. "
                    "Give it a longer one, or reduce `base_step`."
                )
        if not any(is_free(components[name], description) for name, description in self.descriptions.items()):
            yield f"{where}: no component takes steps of any length. Leave it out."
        if (rows := self.scenario.record.decimation) < 2 * shortest:
            yield f"{where}: {pair} rows, and `decimation` in `[record]` is {rows}. Raise that."


def no_component(name: str, scenario: Scenario) -> str:
    """Sentence for a component that the scenario does not have."""
    return f"there is no component `{name}`. {suggest(name, scenario.components)}"


# Signals that inputs follow against the variables of these inputs and the time of the run.


def check_signal(played: Played, variable: Variable) -> Iterator[str]:
    """Problems of a signal with the input that is to follow it."""
    if variable.type == "String":
        yield "a text cannot follow a signal. Give a constant."
        return
    if played.unit and variable.unit and played.unit != variable.unit:
        yield f"the column is in `{played.unit}`, the input in `{variable.unit}`. Convert the column."
    if variable.type in WHOLE:
        if played.interpolation != "hold":
            yield f'an input of type {variable.type} cannot be interpolated. Write `interpolation = "hold"`.'
        items = [0, 1] if variable.type == "Boolean" else [*variable.items.values()]
        fits = np.isin(played.values, items) if items else played.values == np.rint(played.values)
        for value in played.values[~fits][:1]:
            yield f"{value:.9g} found, a value of type {variable.type} is expected. Correct it."
    if variable.type in NUMERIC:
        for value in (float(played.values.min()), float(played.values.max())):
            if not within(value, variable):
                yield f"{value:.9g} found, {limits(variable)} expected. Correct the value."


def check_span(played: Played, experiment: Experiment) -> Iterator[str]:
    """Problem of a signal that does not cover the run."""
    begin, end, slack = float(played.times[0]), float(played.times[-1]), SLACK * experiment.base_step
    if begin > experiment.start + slack or end < experiment.time(experiment.count) - slack:
        span = f"{experiment.start:.9g} s to {experiment.stop:.9g} s"
        yield f"it has values from {begin:.9g} s to {end:.9g} s, the run is from {span}. Add what is missing."


# Both ends of a connection: whether one can follow the other.


def check_types(connection: Connection, source: Variable, target: Variable) -> Iterator[str]:
    """Problems of a connection between types that do not fit, or whose values cannot be converted."""
    ends = f"{connection.source} ({source.type}) -> {connection.target} ({target.type})"
    is_number = target.type == "Real" and source.type in AS_NUMBERS
    if source.type != target.type and not is_number:
        yield (
            f"{connection.place}: {ends}: types differ. Connect variables of one type; only a Real input accepts "
            "others, Boolean and Integer."
        )
    elif source.items and target.items and source.items != target.items:
        found, expected = (", ".join(f"{n} = {k}" for n, k in v.items.items()) for v in (source, target))
        yield f"{connection.place}: {ends}: items differ, {found} and {expected}. Correct the connection."
    elif connection.converts and target.type != "Real":
        yield f"{connection.place}: {ends}: only a Real input takes `factor` and `bias`. Remove them."


def check_units(connection: Connection, source: Variable, target: Variable) -> Iterator[str]:
    """Problem of a connection between different units."""
    sent = connection.unit or (None if connection.converts else source.unit)
    if sent and target.unit and sent != target.unit:
        ends = f"{connection.source} [{source.unit or 'no unit'}] -> {connection.target} [{target.unit}]"
        after = f" after conversion to [{connection.unit}]" if connection.unit else ""
        remedy = "Correct the connection, or give `factor`, `bias` and `unit` in `[[connections]]`."
        yield f"{connection.place}: {ends}: units differ{after}. {remedy}"


# Parameters, parameter sets, seeds and step sizes of components against their model descriptions.


def keep_own_values(scenario: Scenario, descriptions: Descriptions) -> Scenario:
    """Drop what the parameter sets of a component have for others; its own `set` stays as it is.

    Where steps are controlled, what is sampled steps from instant to instant.
    """
    is_controlled, base = scenario.experiment.step_control is not None, scenario.experiment.base_step

    def own(component: Component) -> Component:
        """The component with the values that it has parameters for, and the step that its samples ask for."""
        names = {v.name for v in descriptions[component.name].of("parameter")}
        files = {path.name for path in component.sets}
        values = {n: v for n, v in component.values.items() if n in names or component.origin[n] not in files}
        samples = sample_time(component, descriptions[component.name]) / base if is_controlled else 0.0
        step = round(samples) if is_whole(samples / component.step) else component.step
        return replace(component, values=values, step=step)

    return replace(scenario, components={n: own(c) if n in descriptions else c for n, c in scenario.components.items()})


def check_sets(components: Mapping[str, Component], descriptions: Descriptions) -> Iterator[str]:
    """Names in a parameter set that no component has as a parameter.

    They are told only if all components that are given the set are known. A name that none of these has may belong to
    another component, whose FMU is in the same folder.
    """
    for file in dict.fromkeys(file for component in components.values() for file in component.sets):
        users = [name for name, component in components.items() if file in component.sets]
        if set(users) <= set(descriptions):
            known = [v for user in users for v in descriptions[user].variables.values()]
            variables = {v.name: v for v in sorted(known, key=lambda v: v.is_parameter)}  # the last of a name counts
            names = list(components[users[0]].sets[file])
            if not set(names) <= set(variables):
                folders = {description.path.parent for description in descriptions.values()}
                beside = (parameters_of(file) for f in folders for file in f.glob("*.fmu"))
                others = frozenset().union(*beside)
                names = [name for name in names if name in variables or name not in others]
            problems = [name_problem(name, variables) for name in names]
            yield from (f"{file.name} (given to {listing(users)}): {problem}" for problem in problems if problem)
    for name, description in descriptions.items():
        for file, values in components[name].sets.items() if name in components else ():
            if problem := core_problem(values, description.variables):
                yield f"{file.name}, components.{name}: {problem}"


def check_values(component: Component, description: Description) -> Iterator[str]:
    """Problems with the parameter values of a component, wherever they were given."""
    for name, value in component.values.items():
        if problem := value_problem(name, value, description):
            yield f"components.{component.name} (from {component.origin[name]}): {problem}"
    touched = {description.variables[name].array for name in component.values if name in description.variables}
    for array in sorted(touched - {""}):
        if missing := [v.name for v in description.arrays[array] if v.start is None and v.name not in component.values]:
            yield f"components.{component.name}: `{missing[0]}` is missing. Give all elements of `{array}`, or none."


def value_problem(name: str, value: Value, description: Description) -> str | None:
    """What is wrong with setting a variable to a value before the run, or None."""
    problem = name_problem(name, description.variables, True)
    return problem or misfit(value, description.variables[name], f"`{name}` is {{}}")


def misfit(value: Value, variable: Variable, said: str = "{} found") -> str | None:
    """Why a variable does not take a value, or None; `said` is the beginning of the sentence."""
    if isinstance(value, str) and variable.items and value not in variable.items:
        found = said.format(describe_value(value))
        return f"{found}, an item of the enumeration is expected. {suggest(value, variable.items)}"
    number = variable.number(value)
    if not TAKES[variable.type](number):
        return f"{said.format(describe_value(value))}, a value of type {variable.type} is expected. Correct the value."
    if variable.type in NUMERIC and not within(float(number), variable):
        return f"{said.format(number)}, {limits(variable)} expected. Correct the value."
    return None


def name_problem(name: str, variables: Mapping[str, Variable], takes_starts: bool = False) -> str | None:
    """Why a name is that of no parameter among some variables, or None; some callers take start values too."""
    variable = variables.get(name)
    if variable is None:
        return f"unknown parameter `{name}`. {suggest(name, [v.name for v in variables.values() if v.is_parameter])}"
    if not (variable.is_settable if takes_starts else variable.is_parameter):
        remedy = "Give its value in `[inputs]`." if variable.causality == "input" else "Remove it."
        return f"`{name}` is not a parameter but has the causality `{variable.causality}`. {remedy}"
    return None


def check_seed(component: Component, description: Description, seed: int) -> Iterator[str]:
    """Problems with the seed of a component."""
    place = f"seeds.{component.name}"
    variable = description.variables.get("seed")
    if variable is None or variable.type != "Integer" or not variable.is_parameter:
        yield f"{place}: the FMU `{description.name}` has no Integer parameter `seed`. Remove the entry."
    elif "seed" in component.values:
        yield f"{place}: `seed` is also given in {component.origin['seed']}. Keep one."
    elif not within(float(seed), variable):
        yield f"{place}: {seed} found, {limits(variable)} expected. Correct the value."


def check_grid(component: Component, description: Description, experiment: Experiment) -> Iterator[str]:
    """Problems of a component's step with the experiment and with the sample time of its FMU."""
    place = f"components.{component.name}"
    if component.offset + component.step > experiment.count:
        yield (
            f"{place}: its first step ends after {component.offset + component.step} base steps, "
            f"the run has {experiment.count}. Reduce `step` or `offset`, or run longer."
        )
    step, sample = component.step * experiment.base_step, sample_time(component, description)
    if sample > 0.0 and not (is_whole(step / sample) or is_whole(sample / step)):
        yield (
            f"{place}: its step is {step:.9g} s and `sample_time` is {sample:.9g} s; one must be a whole multiple of "
            "the other. Change `step`, `base_step` or `sample_time`."
        )


def check_swept(
    component: Component,
    description: Description,
    name: str,
    values: Sequence[Value],
    experiment: Experiment,
    column: RowsColumn | None = None,
) -> Iterator[str]:
    """Problems with the values that a sweep gives a parameter of a component, in a list or in a column of its rows."""
    place = f"sweep.{component.name}.{name}"
    if problem := name_problem(name, description.variables, True):
        yield f"{place}: {problem}"
        return
    if description.variables[name].is_structural:
        yield f"{place}: it decides the sizes of arrays. Set it in `components.{component.name}.set`, or in variants."
        return
    unit = description.variables[name].unit or ""
    if column and column.unit not in ("", unit):
        yield (
            f"{place} ({column.file}, line 1, column {column.number}): it is in `{column.unit}`, `{unit or '1'}` is "
            "expected, and nothing is converted. Convert the column."
        )
    for row, value in enumerate(values):
        if problem := value_problem(name, value, description):
            yield f"{place}{f' ({column.place(row)})' if column else ''}: {problem}"
        elif name == "sample_time":
            yield from check_grid(replace(component, values={name: value}), description, experiment)


def is_whole(ratio: float) -> bool:
    """True for a whole number of at least 1, within 1e-9."""
    return math.isfinite(ratio) and round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * round(ratio)


def within(value: float, variable: Variable) -> bool:
    """True if a value lies within the limits of a variable and of its type."""
    low, high = ends(variable)
    return (low is None or value >= low) and (high is None or value <= high)


def ends(variable: Variable) -> tuple[float | None, float | None]:
    """Smallest and largest value of a variable, None where there is no limit."""
    low, high = variable.range or (None, None)
    return low if variable.min is None else variable.min, high if variable.max is None else variable.max


def limits(variable: Variable) -> str:
    """Limits of a variable as messages name them."""
    return format_limits(*ends(variable), ".10g") + (f" {variable.unit}" if variable.unit else "")


@remember
def parameters_of(file: Path) -> frozenset[str]:
    """Names of the parameters of an FMU file; one that cannot be read has none."""
    try:
        root, _text = mend_description(read_description(file)[0])
    except (UnusableError, SyntaxError):  # of the XML, which is reported where the FMU is used
        return frozenset()
    return frozenset(v.get("name", "") for v in root.iter() if v.get("causality") == "parameter")


# Recorded signals, metrics and baseline of a scenario against the signals of its FMUs.


UNKNOWN = 4e9  # bytes, of a machine that does not tell


def check_record(scenario: Scenario, descriptions: Descriptions, knows_times: bool = True) -> Iterator[str]:
    """Problems with what is recorded and with what is made of it; all components must have a description."""
    recorded = recorded_signals(scenario, descriptions)
    yield from check_patterns(scenario.record.signals, signals(descriptions), "record.signals")
    if knows_times:
        yield from check_size(scenario, len(recorded), memory())
    for metric in scenario.metrics:
        yield from metric_problems(metric, recorded, descriptions)
        if metric.event is not None and metric.event not in scenario.events:
            known = suggest(metric.event, scenario.events)
            yield f"metrics.{metric.name}.event: there is no event `{metric.event}`. {known}"
        if knows_times:
            yield from check_window(metric, scenario)
    parameters = [f"{name}.{p.name}" for name, d in descriptions.items() for p in d.of("parameter")]
    for name in scenario.page.controls:
        if name not in parameters:
            yield f"page.controls: `{name}` is no parameter. {suggest(name, parameters)}"
    for name in scenario.page.first:
        if name not in recorded:
            yield f"page.first: {not_recorded(name, recorded, descriptions)}"
    yield from check_patterns(scenario.baseline.signals or (), recorded, "baseline.signals")
    yield from check_patterns(scenario.baseline.tolerances, recorded, "baseline.tolerances")


def check_size(scenario: Scenario, signals: int, most: float) -> Iterator[str]:
    """Problem of a record that does not fit into the memory."""
    rows = scenario.experiment.count // scenario.record.decimation + 1
    size = 8.0 * rows * (signals + 1)
    if size > most:
        found = f"{rows} rows of {signals} signals are {size / 1e9:.3g} GB, at most {most / 1e9:.3g} GB are kept"
        yield f"record: {found}, half the memory. Record fewer signals, or raise `decimation`."


def memory() -> float:
    """Half of the memory of this machine, where it can be asked [bytes]."""
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return UNKNOWN


def check_patterns(patterns: Iterable[str], names: Iterable[str], place: str) -> Iterator[str]:
    """Yield the problem of each pattern that matches nothing."""
    for pattern in patterns:
        if not matching([pattern], names):
            yield f"{place}: `{pattern}` matches no input or output. {suggest(pattern, names)}"


def metric_problems(metric: Metric, recorded: Mapping[str, Variable], descriptions: Descriptions) -> Iterator[str]:
    """Problems of one metric: signals recorded, reference known, times in seconds, units equal."""
    place = f"metrics.{metric.name}"
    flows = {f"flows[{k}]": flow for k, flow in enumerate(metric.flows or ())}
    for key, signal in {"signal": metric.signal, "where": metric.where, "time": metric.time, **flows}.items():
        if signal is not None and signal not in recorded:
            yield f"{place}.{key}: {not_recorded(signal, recorded, descriptions)}"
    units = {name: variable.unit for name, variable in recorded.items() if variable.unit}
    if units.get(metric.time or "", "s") != "s":
        yield f"{place}.time: `{metric.time}` is in {units[metric.time or '']}, s expected. Correct the name."
    name = metric.reference
    if not isinstance(name, str):
        return
    is_axis = KINDS[metric.kind].reference == "axis"
    target = recorded.get(name) or (None if is_axis else parameter(name, descriptions))
    if target is None:
        yield f"{place}.reference: {not_recorded(name, recorded, descriptions)}"
    elif metric.flows and len({(units.get(n), units.get(f)) for n, f in zip((metric.signal, name), metric.flows)}) > 1:
        pairs = zip((metric.signal, name), metric.flows)
        ends = [f"{n} [{units.get(n, '')}] and {f} [{units.get(f, '')}]" for n, f in pairs]
        yield f"{place}: {' at one end, '.join(ends)} at the other: units differ. Correct the signals."
    elif target.unit and not is_axis and units.get(metric.signal, target.unit) != target.unit:
        pair = f"{metric.signal} [{units[metric.signal]}] is compared with {name} [{target.unit}]"
        yield f"{place}: {pair}: units differ. Correct the reference."


def not_recorded(name: str, recorded: Iterable[str], descriptions: Descriptions) -> str:
    """Sentence for a signal that the run does not record."""
    if name in signals(descriptions):
        return f"`{name}` is not recorded. Add it to `record.signals`."
    return f"unknown signal `{name}`. {suggest(name, recorded)}"


def parameter(name: str, descriptions: Descriptions) -> Variable | None:
    """The numeric parameter called `component.parameter`, if there is one."""
    component, _, own = name.partition(".")
    variable = descriptions[component].variables.get(own) if component in descriptions else None
    return variable if variable and variable.is_parameter and variable.type in ("Real", "Integer") else None


# Whether the window of a metric has samples: recorded rows at which the component of its signal has just stepped.


def check_window(metric: Metric, scenario: Scenario) -> Iterator[str]:
    """Problem of a metric that would have no samples, whatever its signals are."""
    if (component := scenario.components.get(metric.signal.partition(".")[0])) is None:
        return
    place = f"metrics.{metric.name}"
    decimation, experiment = scenario.record.decimation, scenario.experiment
    if (first := first_row(component, decimation)) is None:
        yield (
            f"{place}: `{component.name}` never steps at a recorded row: its step is {component.step}, its "
            f"offset {component.offset}, and `record.decimation` {decimation} base steps. Change one of them."
        )
        return
    if metric.time is not None or metric.event is not None:  # times that are known only then
        return
    every, base = lcm(component.step, decimation), experiment.base_step
    if metric.after is not None:
        steps = (metric.after - experiment.time(first)) / base + SLACK
        first += every * (1 + int(min(steps, experiment.count) // every)) if steps >= 0.0 else 0
    is_late = metric.before is not None and experiment.time(first) >= metric.before - SLACK * base
    if first > experiment.count or is_late:
        limits = {"after": metric.after, "before": metric.before}
        window = " and ".join(f"`{key}` = {limit:.9g} s" for key, limit in limits.items() if limit is not None)
        span = f"from {experiment.start:.9g} s to {experiment.stop:.9g} s with a sample every {every * base:.9g} s"
        yield f"{place}: no sample has {window or 'its place'} in a run {span}. Correct the window."


def first_row(component: Component, decimation: int) -> int | None:
    """First base step that is recorded and ends a step of the component; None if there is never one."""
    step, offset = component.step, component.offset
    common = gcd(step, decimation)
    if offset % common:
        return None
    turns = decimation // common  # offset + step * j is a multiple of the decimation for one j of so many
    j = -(offset // common) * pow(step // common, -1, turns) % turns if turns > 1 else 0
    return offset + step * (j or turns)


# What a time grid is too coarse for: components, what drives them, events. It is told, and the run goes on.


FEW = 10  # base steps of a run, and rows of a record
ABOVE = 5.0  # steps of a component that are so many times its own are told
WITHIN = {"s": 10.0, "Hz": 1.0}  # least steps in a period; fewer for a frequency, since drives give means
PULSE = 0.25  # of the span of a signal: what rises so far between two steps is told
ROUNDING = 1e-9
ASKED = "Is `base_step` as it should be?"


def on_grid(scenario: Scenario, descriptions: Descriptions) -> list[str]:
    """Sentences on what falls between the steps of a scenario that has no problems."""
    experiment = scenario.experiment
    told = [*few(experiment, scenario.record.decimation), *both_ways(scenario, descriptions)]
    for name, component in scenario.components.items():
        told += own_step(component, descriptions[name], experiment)
        told += periods(component, descriptions[name], experiment)
    for port, played in scenario.played.items():
        told += pulses(f"inputs.{port}", played, experiment, experiment.base_step)
    for event in scenario.events.values():
        told += short(event, scenario)
    return told


def few(experiment: Experiment, decimation: int) -> Iterator[str]:
    """That a run has few steps, or its record few rows."""
    rows = experiment.count // decimation + 1
    if experiment.count < FEW:
        yield f"experiment: the run has {experiment.count} base steps, too few to show much. {ASKED}"
    elif rows < FEW:
        yield f"record: {rows} rows are recorded, too few to show much. Is `decimation` as it should be?"


def own_step(component: Component, description: Description, experiment: Experiment) -> Iterator[str]:
    """That a component steps much longer than it is made for: than its samples, or than its default experiment."""
    step = component.step * experiment.base_step
    what, own = "`sample_time`", sample_time(component, description)
    if own <= 0.0 and description.step_size:
        what, own = "the step of its FMU's default experiment", description.step_size
    if own > 0.0 and step > ABOVE * own * (1.0 + ROUNDING):
        yield (
            f"components.{component.name}: its step is {step:.9g} s, {step / own:.4g} times {what}, {own:.9g} s: what "
            f"happens between is lost. {ASKED}"
        )


def periods(component: Component, description: Description, experiment: Experiment) -> Iterator[str]:
    """Periods and pulses of what a component generates that its steps do not resolve."""
    step = component.step * experiment.base_step
    values = {**description.starts, **component.values}
    ports = {port.name: port for port in description.rules.ports} if description.rules else {}
    choices = {choice: values.get(p.name) == choice for p in ports.values() for choice in p.choices}
    for variable in description.of("parameter"):
        name, value = variable.name, values.get(variable.name)
        group, _, last = name.rpartition(".")
        if not choices.get(group.partition(".")[0], True):  # of what is not chosen
            continue
        word = {"s": "period", "Hz": "frequency"}.get(variable.unit or "")
        if word and last.endswith(word) and is_number(value) and float(value or 0.0) > 0.0:
            period = float(value or 0.0) if word == "period" else 1.0 / float(value or 1.0)
            if period < WITHIN[variable.unit or ""] * step * (1.0 - ROUNDING):
                yield (
                    f"components.{component.name}: `{name}` is {value} {variable.unit}, a period of {period:.9g} s, and"
                    f" its step {step:.9g} s: its changes fall between two steps. {ASKED}"
                )
        columns = ports[name].columns if name in ports else ()
        if columns and isinstance(value, str) and name in component.values and is_file(name, value):
            yield from of_table(f"components.{component.name}.{name}", value, columns[0], experiment, step)


def of_table(place: str, file: str, first: str, experiment: Experiment, step: float) -> Iterator[str]:
    """Pulses of a table over time."""
    if not first.startswith("time"):
        return
    try:
        columns = read_columns(Path(file))
    except (OSError, ValueError):  # which the FMU tells
        return
    times = columns.pop("time", np.empty(0))
    for values in columns.values():
        yield from pulses(place, Played(times, values), experiment, step)


def pulses(place: str, played: Played, experiment: Experiment, step: float) -> Iterator[str]:
    """Samples of a signal that no step comes near: a pulse between two steps."""
    is_inside = (played.times > experiment.start) & (played.times < experiment.stop)
    times, values = played.times[is_inside], played.values[is_inside]
    if not times.size or not (span := float(np.ptp(played.values))) > 0.0:
        return
    before = np.floor((times - experiment.start) / step + ROUNDING)
    slack = ROUNDING * step
    ends = [played.at(experiment.start + (before + k) * step, slack) for k in (0, 1)]
    far = np.maximum(values - np.maximum(*ends), np.minimum(*ends) - values) > PULSE * span
    if far.any():
        yield (
            f"{place}: {int(far.sum())} samples, the first at {times[np.argmax(far)]:.9g} s, lie in pulses between two "
            f"steps of {step:.9g} s, so no component sees them. {ASKED}"
        )


def short(event: Event, scenario: Scenario) -> Iterator[str]:
    """An event that is over before the component of its target steps, or before a row is recorded."""
    experiment, component = scenario.experiment, scenario.components.get(event.target.component)
    length = event.duration
    if length is None and event.at is not None and event.until is not None:
        length = event.until - event.at
    every = max(component.step if component else 1, scenario.record.decimation) * experiment.base_step
    if event.enabled and length is not None and length < every * (1.0 - ROUNDING):
        yield (
            f"events.{event.name}: it lasts {length:.9g} s, and its target steps or is recorded every {every:.9g} s: "
            "it may be missed. Let it last longer, or step and record more often."
        )


# Events of a scenario against its FMUs and its time grid.


def check_events(
    scenario: Scenario, descriptions: Descriptions, events: Mapping[str, Event], place: str, knows_times: bool
) -> Iterator[str]:
    """Problems of events with the FMUs and, where the time grid is known, with that."""
    if events and SECTION in scenario.components:
        yield f"components.{SECTION}: in a scenario with events, no component may have this name. Rename it."
    for event in events.values():
        at = f"{place}.{event.name}"
        yield from (f"{at}.{problem}" for problem in target_problems(event, scenario, descriptions))
        yield from (f"{at}.when.signal: {problem}" for problem in signal_problems(event, scenario, descriptions))
        if knows_times:
            yield from (f"{at}.{problem}" for problem in time_problems(event, scenario.experiment))
            yield from (f"{at}.{problem}" for problem in start_problem(event, scenario, descriptions))


def target_problems(event: Event, scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problems with the target of an event, and with what is done to it."""
    name = event.target.component
    if name not in scenario.components:
        yield f"target: {no_component(name, scenario)}"
        return
    for one in resolve_targets({"": event}, scenario.connections).values():
        description = descriptions.get(one.target.component)
        if description is None:
            continue
        variable = description.variables.get(one.target.variable)
        if problem := refusal(one, variable, description):
            yield problem
        elif variable is not None:
            yield from value_problems(one, variable, scenario, description)


def refusal(event: Event, variable: Variable | None, description: Description) -> str:
    """Why an event cannot act on a variable at all, or nothing."""
    port, action = event.target, ACTIONS[event.action]
    tunable = [v.name for v in description.variables.values() if v.is_tunable]
    if variable is None:
        known = [*(v.name for c in ("input", "output") for v in description.of(c)), *tunable]
        return f"target: unknown variable `{port.variable}` in `{port.component}`. {suggest(port.variable, known)}"
    if variable.causality == "output":
        return f"target: the output `{port}` drives no input. Connect it, or choose another target."
    if variable.causality != "input" and not variable.is_tunable:
        others = f"tunable ones are {listing(tunable)}" if tunable else "it has none that is tunable"
        return f"target: `{port}` is fixed and cannot change during a run; {others}. Choose another target."
    if variable.type == "String":
        return f"target: `{port}` is a text, which events cannot change. Choose another target."
    if action.only_real and variable.type != "Real":
        return f"action: `{event.action}` needs a target of type Real, `{port}` is {variable.type}. Use `set`."
    if variable.is_tunable and not action.on_parameter:
        return f"action: `{event.action}` is for inputs, `{port}` is a parameter. Choose another action."
    return ""


def value_problems(event: Event, variable: Variable, scenario: Scenario, description: Description) -> Iterator[str]:
    """Values that the target does not take, as far as they are known before the run."""
    result = event.value if event.action in ("set", "ramp") else None
    if result is not None and (problem := misfit(result, variable)):
        yield f"value: {problem}"
    elif variable.is_tunable:
        values = {**description.starts, **scenario.components[event.target.component].values}
        result = apply_change(event, values.get(variable.name)) if result is None else result
        problems = [] if result is None else tuned_problems(variable, result, values, description)
        yield from (f"value: `{event.target}` becomes {result}: {problem} Correct the value." for problem in problems)


def tuned_problems(
    variable: Variable, result: Value, values: Mapping[str, Value], description: Description
) -> list[str]:
    """Why a component does not take a new value of a parameter beside those of the others."""
    if is_number(result) and not within(float(result), variable):
        return [f"{limits(variable)} expected."]
    if description.rules is None:
        return []
    before = broken_rules(description.rules, values)
    now = broken_rules(description.rules, {**values, variable.name: result})
    return [f"{problem.rstrip('.')}." for problem in now if problem not in before]


def apply_change(event: Event, nominal: Value | None) -> float | None:
    """Compute what a shift or a factor makes of a parameter; None where that is not known."""
    if not (is_number(nominal) and is_number(event.value)) or event.action not in ("bias", "scale"):
        return None
    own, other = float(nominal or 0.0), float(event.value or 0.0)
    return own + other if event.action == "bias" else own * other


def signal_problems(event: Event, scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problems with the signal of a condition."""
    if event.when is None:
        return
    port: Port = event.when.signal
    if port.component not in scenario.components:
        yield no_component(port.component, scenario)
    elif port.component in descriptions:
        variables = descriptions[port.component].variables
        known = [v.name for v in variables.values() if v.causality in ("input", "output") and v.type != "String"]
        if port.variable not in known:
            found = "no input or output that is a number" if port.variable in variables else "unknown"
            yield f"`{port}`: {found}. {suggest(port.variable, known)}"


def time_problems(event: Event, experiment: Experiment) -> Iterator[str]:
    """Times that are not on base steps or outside of the run, durations that are no whole number of base steps."""
    after, lasting = (event.when.after, event.when.lasting or None) if event.when else (None, None)
    begins = {"at": event.at, "when.after": after}
    for key, time in {**begins, "until": event.until}.items():
        is_near = time is not None and abs(index_of(time, experiment)) <= MOST_STEPS
        if time is not None and is_near and not is_on_grid(time, experiment):
            between = " and ".join(f"{t:.9g} s" for t in neighbours(time, experiment))
            yield f"{key}: {time:.9g} s is not a base step; the nearest are {between}. Choose one of them."
    last = {**dict.fromkeys(begins, experiment.count), "until": MOST_STEPS}
    for key, time in {**begins, "until": event.until}.items():
        if time is not None and not 0 <= index_of(time, experiment) <= last[key]:
            span = f"{experiment.start:.9g} s to {experiment.stop:.9g} s"
            yield f"{key}: {time:.9g} s is outside the run from {span}. Correct the time."
    lengths = {"over": event.over, "duration": event.duration, "when.for": lasting}
    for key, length in lengths.items():
        if length is not None and not is_whole(length / experiment.base_step):
            found = f"{length:.9g} s is {length / experiment.base_step:.9g} base steps of {experiment.base_step:.9g} s"
            yield f"{key}: {found}, a whole number of at least 1 expected. Correct the time."


def start_problem(event: Event, scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problem of an event on an input at the start that needs what was before."""
    description = descriptions.get(event.target.component)
    variable = description.variables.get(event.target.variable) if description else None
    at_start = event.at is not None and index_of(event.at, scenario.experiment) == 0
    if variable is not None and not variable.is_parameter and at_start and ACTIONS[event.action].remembers:
        remedy = "Begin later, or use `set`."
        yield f"at: at the start there is no earlier value for `{event.action}` to begin with. {remedy}"


# Whether components drive each other with a delay, and whether its error was measured.


def sample_time(component: Component, description: Description) -> float:
    """The sample time of a component [s]; 0 for one that has none."""
    variable = description.variables.get("sample_time")
    given = component.values.get("sample_time", variable.start if variable else None)
    return float(given or 0.0) if is_number(given) else 0.0


def is_sampled(component: Component, description: Description) -> bool:
    """True for a component with instants of its own: what lies between them is no error of a step."""
    return sample_time(component, description) > 0.0


def is_free(component: Component, description: Description) -> bool:
    """True for a component whose steps may be controlled: it takes any, and has no instants of its own."""
    return component.step == 1 and description.can_vary and not is_sampled(component, description)


def both_ways(scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Sentence on the first two components that drive each other with a delay, unless the error was measured.

    The delay of a sampled component on the way is intended, and not one of the coupling.
    """
    free = {n for n, c in scenario.components.items() if n in descriptions and not is_sampled(c, descriptions[n])}
    wires = [c for c in scenario.connections if {c.source.component, c.target.component} <= free]
    wires = [c for c in wires if c.source.component != c.target.component]
    loops = [c for c in wires if c.source.component in find_reached(c.target.component, wires)]
    if scenario.experiment.step_control is not None:
        return  # which sees to that error
    if loops and scenario.experiment.method != "jacobi":  # in which every connection is delayed
        is_explicit = scenario.experiment.method == "gauss-seidel"
        order = execution_order([*scenario.components], scenario.connections, descriptions) if is_explicit else None
        loops = [c for c in loops if (c in order.delayed if order else c.delayed)]
    found = facts_beside(measured_file(scenario)) if loops else {}
    is_measured = is_sealed(found) and found.get("of") == subject(scenario, descriptions)
    if loops and not is_measured:
        first = loops[0]
        yield (
            f"connections: `{first.source.component}` and `{first.target.component}` drive each other, `{first}` one "
            f"step late: `gapsense converge {scenario.called} --write` tells the error."
        )


# What was measured stands in a file beside the scenario, as a baseline does.


def measured_file(scenario: Scenario) -> Path:
    """File with the measured errors of a scenario or of its variant."""
    name = f"converged.{scenario.variant}.json" if scenario.variant else "converged.json"
    return scenario.path.parent / name


def subject(scenario: Scenario, descriptions: Descriptions) -> Any:
    """Hash of what decides the error: the scenario but for its words, and the FMUs by the GUIDs of their variables."""
    return fingerprint([deciding(scenario), {name: d.guid for name, d in descriptions.items()}])
