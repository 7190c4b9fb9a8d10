"""Hold a scenario against the model descriptions of its FMUs; nothing is loaded or run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import chain
from math import prod
from pathlib import Path
from typing import TypeVar

import numpy as np

from gapsense._os.files import state
from gapsense.cosim.check.record import check_record
from gapsense.cosim.check.values import (
    check_grid,
    check_seeds,
    check_sets,
    check_swept,
    check_values,
    limits,
    misfit,
    value_problem,
    within,
)
from gapsense.cosim.events.event import SECTION, Event
from gapsense.cosim.events.read import check_events, varied
from gapsense.cosim.fmu.archive import UnusableError
from gapsense.cosim.fmu.descriptions import (
    NUMERIC,
    Description,
    Descriptions,
    Variable,
    broken_rules,
    describe,
    find_fmu,
)
from gapsense.cosim.scenario.elements import Component, Connection, Experiment, Port
from gapsense.cosim.scenario.input_signals import SLACK, Played
from gapsense.cosim.scenario.order import FeedthroughCycleError, execution_order
from gapsense.cosim.scenario.records import Points, Scenario
from gapsense.problems import suggest
from gapsense.shipped import NATIVE_FOLDER
from gapsense.tables import Value, is_integer

WHOLE = ("Integer", "Boolean", "Enumeration")
AS_NUMBERS = ("Boolean", "Integer")  # types of which a Real input takes the number; true is 1
MOST_POINTS = 10**6  # of a sweep
MOST_JUDGED = 1000  # combinations for a component, and all its values; the FMU tells the others
T = TypeVar("T")
OWN = "Build the FMUs with `gapsense build%s`."  # remedies for an FMU that is missing
FOREIGN = "Correct the path; it is relative to the scenario."


def read_descriptions(scenario: Scenario, fmus: Path, problems: list[str]) -> dict[str, Description]:
    """Model description of each component whose FMU can be read; each FMU file is read once."""
    known: dict[Path, Description | None] = {}
    out = {}
    own = OWN % (" --native" if NATIVE_FOLDER.name in fmus.parts[-2:] else "")
    for name, component in scenario.components.items():
        path = find_fmu(component.fmu, scenario.path, fmus)
        remedy = FOREIGN if component.fmu.endswith(".fmu") else own
        if path not in known:
            known[path] = read_description(path, f"{scenario.path.name}, components.{name}.fmu", remedy, problems)
        description = known[path]
        if description is not None:
            out[name] = sized(description, component, problems)
    return out


def sized(description: Description, component: Component, problems: list[str]) -> Description:
    """The same with arrays of the sizes that a component has."""
    structural = [v for v in description.variables.values() if v.is_structural]
    given = {v.name: component.values[v.name] for v in structural if v.name in component.values}
    sizes = {name: int(value) for name, value in given.items() if is_integer(value) and int(value) >= 0}
    try:
        return described(description.path, tuple(sizes.items())) if sizes else description
    except UnusableError as error:
        problems.append(f"components.{component.name}: `{description.path}` cannot be used like this: {error}")
        return description


def read_description(path: Path, place: str, remedy: str, problems: list[str]) -> Description | None:
    """Model description of an FMU, or None after noting why there is none."""
    if not path.is_file():
        present = sorted(file.stem for file in path.parent.glob("*.fmu"))
        hint = suggest(path.stem, present) if present else "That folder has no FMU."
        problems.append(f"{place}: there is no FMU `{path}`. {hint} {remedy}")
        return None
    try:
        return described(path)
    except UnusableError as error:
        problems.append(f"{place}: `{path}` cannot be used: {error}")
        return None


def described(path: Path, sizes: tuple[tuple[str, int], ...] = ()) -> Description:
    """Model description of an FMU file, read again only if the file has changed."""
    return remembered(path.resolve(), sizes, *state(path))


@lru_cache(maxsize=64)
def remembered(path: Path, sizes: tuple[tuple[str, int], ...], *_: int) -> Description:
    """Model description of a file in some state."""
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

    rows = {tuple(own(row).items()): None for row in scenario.rows}
    points = Points([*map(dict, rows)] or ({},), own(scenario.grid))
    for index in points.telling(MOST_JUDGED):
        yield {port.variable: value for port, value in points[index].items()}


class Checker:
    """The checks of one scenario; each yields its problems."""

    def __init__(self, scenario: Scenario, descriptions: Descriptions, broken: frozenset[str]) -> None:
        self.scenario, self.descriptions, self.broken = scenario, descriptions, broken

    def problems(self) -> Iterator[str]:
        """All problems, in the order of the file."""
        sets = check_sets(self.scenario.components, self.descriptions)
        wiring = (self.connections(), self.inputs(), self.driven(), self.loops())
        values = (self.values(), self.rules(), *wiring, self.events(), self.seeds(), self.grid())
        for problem in chain(self.singles(), sets, *values):
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
                yield f"seeds.{name}: {self.no_component(name)}"
            elif name in self.descriptions:
                yield from check_seeds(self.scenario.components[name], self.descriptions[name], seed)

    def grid(self) -> Iterator[str]:
        """Values of a sweep: not too many, of known parameters, of the right type and in their limits, no seeds."""
        lengths = [len(self.scenario.rows) or 1, *map(len, self.scenario.grid.values())]
        if prod(lengths) > MOST_POINTS:
            found = f"{' x '.join(map(str, lengths))} values make {prod(lengths):.9g} combinations"
            yield f"sweep: {found}, at most {MOST_POINTS} are allowed. Shorten a list."
        of_components = {port: values for port, values in self.scenario.swept.items() if not self.is_event(port)}
        for port, values in of_components.items():
            if port.component not in self.scenario.components:
                yield f"sweep.{port}: {self.no_component(port.component)}"
            elif port.variable == "seed" and port.component in self.scenario.seeds:
                yield f"sweep.{port}: the seed is also given in `seeds.{port.component}`. Keep one."
            elif port.component in self.descriptions:
                component, description = self.scenario.components[port.component], self.descriptions[port.component]
                column = self.scenario.rows_columns.get(port)
                yield from check_swept(component, description, port.variable, values, self.scenario.experiment, column)

    def events(self) -> Iterator[str]:
        """Events: targets, values, conditions and times, also for the combinations of a sweep."""
        yield from self.of_events(self.scenario.events, SECTION)
        for swept in own_points(self.scenario, SECTION):
            if swept:
                problems: list[str] = []
                events = varied(self.scenario.events, {Port(SECTION, n): v for n, v in swept.items()}, problems)
                yield from problems or self.of_events(events, f"sweep, {SECTION}")

    def is_event(self, port: Port) -> bool:
        """True if a sweep varies a key of an event."""
        return port.component == SECTION and SECTION not in self.scenario.components

    def of_events(self, events: Mapping[str, Event], place: str) -> Iterator[str]:
        """Problems of events."""
        return check_events(self.scenario, self.descriptions, events, place, "experiment" not in self.broken)

    def no_component(self, name: str) -> str:
        """Sentence for a component that the scenario does not have."""
        return f"there is no component `{name}`. {suggest(name, self.scenario.components)}"

    def resolve(self, port: Port, causality: str, place: str) -> Iterator[str]:
        """Problems of a port that must be an input or output of a component."""
        if port.component not in self.scenario.components:
            yield f"{place}: {self.no_component(port.component)}"
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
        for port, value in self.scenario.inputs.items():
            yield from self.resolve(port, "input", f"inputs.{port}")
            variable = self.variable(port)
            problem = None if variable is None else misfit(value, variable)
            if problem:
                yield f"inputs.{port}: {problem}"
        for port, played in self.scenario.played.items():
            yield from self.resolve(port, "input", f"inputs.{port}")
            variable = self.variable(port)
            problems = [] if variable is None else [*check_signal(played, variable)]
            problems += [] if "experiment" in self.broken else [*check_span(played, self.scenario.experiment)]
            yield from (f"inputs.{port}: {problem}" for problem in problems)

    def driven(self) -> Iterator[str]:
        """Every input driven exactly once."""
        drivers: dict[Port, list[str]] = {}
        for connection in self.scenario.connections:
            drivers.setdefault(connection.target, []).append(connection.place)
        for port in (*self.scenario.inputs, *self.scenario.played):
            drivers.setdefault(port, []).append(f"inputs.{port}")
        for port, place in self.started():
            drivers.setdefault(port, []).append(place)
        for port, places in drivers.items():
            if len(places) > 1:
                yield f"{places[-1]}: `{port}` is driven {len(places)} times, by {', '.join(places)}. Keep one."
        if not self.broken & {"connections", "inputs"}:
            yield from self.idle(drivers)

    def started(self) -> Iterator[tuple[Port, str]]:
        """Inputs to which the `set` of their component or else a sweep gives a value, and where."""
        for name, description in self.descriptions.items():
            given = self.scenario.components[name].values
            for port in (Port(name, variable.name) for variable in description.of("input")):
                if port.variable in given:
                    yield port, f"components.{name}.set"
                elif port in self.scenario.swept:
                    yield port, f"sweep.{port}"

    def idle(self, drivers: Mapping[Port, list[str]]) -> Iterator[str]:
        """Inputs that nothing drives."""
        for name, description in self.descriptions.items():
            for variable in description.of("input"):
                port = Port(name, variable.name)
                if port not in drivers:
                    start = "" if variable.start is None else f" (its start value is {variable.start})"
                    yield f"components.{name}: nothing drives `{port}`. Connect it or list it in `[inputs]`{start}."

    def loops(self) -> Iterator[str]:
        """No loop of direct feedthrough."""
        known = [c for c in self.scenario.connections if self.variable(c.source) and self.variable(c.target)]
        try:
            execution_order([n for n in self.scenario.components if n in self.descriptions], known, self.descriptions)
        except FeedthroughCycleError as error:
            yield f"connections: {error}"


# Signals that inputs follow against the variables of these inputs and the time of the run.


def check_signal(played: Played, variable: Variable) -> Iterator[str]:
    """Problems of a signal with the input that is to follow it."""
    if variable.type == "String":
        yield "a text cannot follow a signal. Give a constant."
        return
    if played.unit and variable.unit and played.unit != variable.unit:
        yield f"the column is in `{played.unit}`, the input in `{variable.unit}`. Convert the column."
    if variable.type in WHOLE:
        yield from check_whole(played, variable)
    if variable.type in NUMERIC:
        for value in (float(played.values.min()), float(played.values.max())):
            if not within(value, variable):
                yield f"{value:.9g} found, {limits(variable)} expected. Correct the value."


def check_whole(played: Played, variable: Variable) -> Iterator[str]:
    """Problems of a signal for an input that takes whole numbers only."""
    if played.interpolation != "hold":
        yield f'an input of type {variable.type} cannot be interpolated. Write `interpolation = "hold"`.'
    items = [0, 1] if variable.type == "Boolean" else [*variable.items.values()]
    fits = np.isin(played.values, items) if items else played.values == np.rint(played.values)
    for value in played.values[~fits][:1]:
        yield f"{value:.9g} found, a value of type {variable.type} is expected. Correct it."


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
