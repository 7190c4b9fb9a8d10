"""Hold a scenario against the model descriptions of its FMUs; nothing is loaded or run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import chain
from pathlib import Path

from gapsense.cosim.check_record import check_record
from gapsense.cosim.check_values import check_grid, check_seeds, check_sets, check_swept, check_values, limits, within
from gapsense.cosim.descriptions import Description, Descriptions, Variable, describe, find_fmu
from gapsense.cosim.order import FeedthroughCycleError, execution_order
from gapsense.cosim.scenario import Connection, Port, Scenario
from gapsense.problems import suggest


def read_descriptions(scenario: Scenario, fmus: Path, problems: list[str]) -> dict[str, Description]:
    """Model description of each component whose FMU can be read; each FMU file is read once."""
    known: dict[Path, Description | None] = {}
    out = {}
    for name, component in scenario.components.items():
        path = find_fmu(component.fmu, scenario.path, fmus)
        if path not in known:
            known[path] = read_description(path, f"{scenario.path.name}, components.{name}.fmu", problems)
        description = known[path]
        if description is not None:
            out[name] = description
    return out


def read_description(path: Path, place: str, problems: list[str]) -> Description | None:
    """Model description of an FMU, or None after noting why there is none."""
    if not path.is_file():
        present = sorted(file.stem for file in path.parent.glob("*.fmu"))
        hint = suggest(path.stem, present) if present else "That folder has no FMU."
        problems.append(f"{place}: there is no FMU `{path}`. {hint} Build the FMUs with `gapsense build`.")
        return None
    try:
        return described(path)
    except ValueError as error:
        problems.append(f"{place}: `{path}` cannot be used: {error}. Build it again with `gapsense build`.")
        return None


def described(path: Path) -> Description:
    """Model description of an FMU file, read again only if the file has changed."""
    about = path.stat()
    return remembered(path.resolve(), about.st_mtime_ns, about.st_size, about.st_ino)


@lru_cache(maxsize=64)
def remembered(path: Path, *state: int) -> Description:
    """Model description of a file in some state."""
    return describe(path)


def check_scenario(scenario: Scenario, descriptions: Descriptions, broken: frozenset[str] = frozenset()) -> list[str]:
    """Everything in a scenario that does not fit the FMUs, each with file and place.

    Components without a description are left out; the gaps of sections that are `broken`, that is could not be read
    completely, are no problems of their own.
    """
    problems = list(dict.fromkeys(Checker(scenario, descriptions, broken).problems()))
    is_complete = len(descriptions) == len(scenario.components)
    if is_complete and not broken & {"record", "components"}:
        problems += [f"{scenario.path.name}, {problem}" for problem in check_record(scenario, descriptions)]
    return problems


class Checker:
    """The checks of one scenario; each yields its problems."""

    def __init__(self, scenario: Scenario, descriptions: Descriptions, broken: frozenset[str]) -> None:
        self.scenario, self.descriptions, self.broken = scenario, descriptions, broken

    def problems(self) -> Iterator[str]:
        """All problems, in the order of the file."""
        sets = check_sets(self.scenario.components, self.descriptions)
        wiring = (self.connections(), self.inputs(), self.driven(), self.loops())
        for problem in chain(self.singles(), sets, self.values(), *wiring, self.seeds(), self.grid()):
            yield f"{self.scenario.path.name}, {problem}"

    def singles(self) -> Iterator[str]:
        """No second instance of an FMU that can have only one per process."""
        first: dict[Path, str] = {}
        for name, description in self.descriptions.items():
            other = first.setdefault(description.path, name)
            if description.is_single and other != name:
                yield f"components.{name}.fmu: `{other}` uses it too, and a process can hold only one. Remove one."

    def values(self) -> Iterator[str]:
        """Parameters: known, of the right type, within their limits; steps that fit the sample time."""
        for name, description in self.descriptions.items():
            component = self.scenario.components[name]
            yield from check_values(component, description)
            if "experiment" not in self.broken:
                yield from check_grid(component, description, self.scenario.experiment)

    def seeds(self) -> Iterator[str]:
        """Seeds: of components that have one, stated once."""
        for name, seed in self.scenario.seeds.items():
            if name not in self.scenario.components:
                yield f"seeds.{name}: {self.no_component(name)}"
            elif name in self.descriptions:
                yield from check_seeds(self.scenario.components[name], self.descriptions[name], seed)

    def grid(self) -> Iterator[str]:
        """Values of a sweep: of known parameters, of the right type, within their limits, and no seeds."""
        for port, values in self.scenario.swept.items():
            if port.component not in self.scenario.components:
                yield f"sweep.{port}: {self.no_component(port.component)}"
            elif port.variable == "seed" and port.component in self.scenario.seeds:
                yield f"sweep.{port}: the seed is also given in `seeds.{port.component}`. Keep one."
            elif port.component in self.descriptions:
                component, description = self.scenario.components[port.component], self.descriptions[port.component]
                column = self.scenario.rows_columns.get(port)
                yield from check_swept(component, description, port.variable, values, self.scenario.experiment, column)

    def no_component(self, name: str) -> str:
        """Sentence for a component that the scenario does not have."""
        return f"there is no component `{name}`. {suggest(name, self.scenario.components)}"

    def resolve(self, port: Port, causality: str, place: str) -> Iterator[str]:
        """Problems of a port that must be a Real input or output of a component."""
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
        elif variable.type != "Real":
            yield f"{place}: `{port}` is of type {variable.type}; only Real variables can be wired. Leave it out."

    def variable(self, port: Port) -> Variable | None:
        """The variable of a port, or None where it is unknown."""
        description = self.descriptions.get(port.component)
        return description.variables.get(port.variable) if description else None

    def connections(self) -> Iterator[str]:
        """Both ends known, and of the same unit unless the connection converts."""
        for connection in self.scenario.connections:
            is_long = connection.place.endswith("]")
            yield from self.resolve(connection.source, "output", connection.place + ".from" * is_long)
            yield from self.resolve(connection.target, "input", connection.place + ".to" * is_long)
            yield from self.units(connection)

    def units(self, connection: Connection) -> Iterator[str]:
        """Problem of a connection between different units."""
        source, target = self.variable(connection.source), self.variable(connection.target)
        if source is None or target is None:
            return
        sent = connection.unit or (None if connection.converts else source.unit)
        if sent and target.unit and sent != target.unit:
            ends = f"{connection.source} [{source.unit or 'no unit'}] -> {connection.target} [{target.unit}]"
            after = f" after conversion to [{connection.unit}]" if connection.unit else ""
            remedy = "Correct the connection, or give `factor`, `bias` and `unit` in `[[connections]]`."
            yield f"{connection.place}: {ends}: units differ{after}. {remedy}"

    def inputs(self) -> Iterator[str]:
        """Constant inputs known and within their limits."""
        for port, value in self.scenario.inputs.items():
            yield from self.resolve(port, "input", f"inputs.{port}")
            variable = self.variable(port)
            if variable is not None and not within(value, variable):
                yield f"inputs.{port}: {value:.9g} found, {limits(variable)} expected. Correct the value."

    def driven(self) -> Iterator[str]:
        """Every input driven exactly once."""
        drivers: dict[Port, list[str]] = {}
        for connection in self.scenario.connections:
            drivers.setdefault(connection.target, []).append(connection.place)
        for port in self.scenario.inputs:
            drivers.setdefault(port, []).append(f"inputs.{port}")
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
                if variable.type == "Real" and port not in drivers:
                    start = "" if variable.start is None else f" (its start value is {variable.start})"
                    yield f"components.{name}: nothing drives `{port}`. Connect it or list it in `[inputs]`{start}."

    def loops(self) -> Iterator[str]:
        """No loop of direct feedthrough."""
        known = [c for c in self.scenario.connections if self.variable(c.source) and self.variable(c.target)]
        try:
            execution_order([n for n in self.scenario.components if n in self.descriptions], known, self.descriptions)
        except FeedthroughCycleError as error:
            yield f"connections: {error}"
