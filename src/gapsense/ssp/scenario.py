"""The content of a scenario, made of what a package says."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from gapsense.cosim.fmu.archive import shown
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.fmu.variables import Variable
from gapsense.problems import listing, suggest
from gapsense.ssp.flat import Way, Wiring
from gapsense.ssp.structure import Element, Path
from gapsense.ssp.told import Told
from gapsense.ssp.units import Line, Units, conversion
from gapsense.ssp.values import Given, Node
from gapsense.tables import Value

ZERO: Mapping[str, Value] = {"Real": 0.0, "Boolean": False, "String": ""}


@dataclass
class Maker:
    """Makes the sections of a scenario; `problems` and `notes` take what is wrong, and what is left out."""

    components: list[Element]
    names: Mapping[Path, str]
    fmus: Mapping[Path, str]  # as the scenario names them
    descriptions: Mapping[Path, Description]
    wiring: Wiring
    given: Mapping[Node, Given]
    units: Units
    told: Told
    problems: list[str]
    notes: list[str]
    connect: dict[str, str] = field(default_factory=dict)
    connections: list[dict[str, Any]] = field(default_factory=list)
    inputs: dict[str, Any] = field(default_factory=dict)
    seeds: dict[str, Value] = field(default_factory=dict)
    idle: list[str] = field(default_factory=list)
    reached: set[Node] = field(default_factory=set)  # where values come from

    def made(self, title: str, experiment: Mapping[str, Any]) -> dict[str, Any]:
        """Tables of the scenario."""
        base = experiment.get("base_step")
        components = {self.names[one.path]: self.component(one, base) for one in self.components}
        self.refuse_strange_ends()
        self.note_unused()
        if self.idle:
            self.notes.append(f"nothing drives {listing(self.idle)}; they keep the start values of their FMUs.")
        about = {
            key: self.told.own[key] for key in ("description", "figure") if isinstance(self.told.own.get(key), str)
        }
        sections = {
            "components": components,
            "connect": self.connect,
            "connections": self.connections,
            "inputs": self.inputs,
            "seeds": self.seeds,
            **self.told.rest(),
        }
        tables = {name: section for name, section in sections.items() if section}
        return {"title": self.told.own.get("title", title), **about, "experiment": dict(experiment), **tables}

    def component(self, element: Element, base_step: float | None) -> dict[str, Any]:
        """One component; its inputs are connected or get a value."""
        name, description = self.names[element.path], self.descriptions[element.path]
        known = {(element.path, v.name): v for v in description.variables.values()}
        signals = self.told.signals()
        for node, variable in known.items():
            if variable.causality == "input" and f"{name}.{variable.name}" in signals:
                self.inputs[f"{name}.{variable.name}"] = signals[f"{name}.{variable.name}"]
            elif variable.causality == "input":
                self.drive(name, node, variable)
        found = {v.name: self.parameter(node, v) for node, v in known.items() if v.causality != "input"}
        values = {key: value for key, value in found.items() if value is not None}
        if name in self.told.table("seeds") and "seed" in values:
            self.seeds[name] = values.pop("seed")
        made = {"fmu": self.fmus[element.path], **self.told.component(name, element.xml, base_step)}
        return {**made, **({"set": values} if values else {})}

    def drive(self, name: str, node: Node, variable: Variable) -> None:
        """Connection or value of an input."""
        way, target = self.way(node), f"{name}.{variable.name}"
        if way and way.source[0] in self.descriptions:
            self.link(way, target, variable)
            if node in self.given:
                self.notes.append(f"{target}: its start value is left out, since it is connected.")
            return
        value = self.through(way, variable) if way else self.valued(node, variable.unit or "")
        if value is None:
            self.idle.append(target)
            value = ZERO.get(variable.type, 0) if variable.start is None else variable.start
        self.inputs[target] = value

    def link(self, way: Way, target: str, variable: Variable) -> None:
        """Connection to an input."""
        path, output = way.source
        source = f"{self.names[path]}.{output}"
        delayed = {"delayed": True} if (source, target) in self.told.delayed() else {}
        gives = self.descriptions[path].variables.get(output)
        is_other = bool(gives and gives.unit and variable.unit and gives.unit != variable.unit)
        if way.line == Line() and not is_other and not delayed:
            self.connect[target] = source
            return
        converts = {"factor": way.line.factor, "bias": way.line.offset} if way.line != Line() or is_other else {}
        unit = {"unit": variable.unit} if converts and variable.unit else {}
        self.connections.append({"from": source, "to": target, **converts, **unit, **delayed})

    def parameter(self, node: Node, variable: Variable) -> Value | None:
        """Value of a parameter or another variable that has a start value, or None if it keeps its own."""
        way = self.way(node) if node in self.wiring.edges else None
        if way and way.source[0] in self.descriptions:
            name = ".".join((self.names[node[0]], variable.name))
            self.problems.append(
                f"{name}: it is connected to `{shown(way.source[1])}`, only inputs may be. Set a value."
            )
            return None
        value = self.through(way, variable) if way else self.valued(node, variable.unit or "")
        return None if value == variable.start and not variable.is_settable else value

    @cached_property
    def units_of_variables(self) -> dict[Node, str]:
        """Units that the FMUs state."""
        every = ((path, v) for path, own in self.descriptions.items() for v in own.variables.values())
        return {(path, v.name): v.unit or "" for path, v in every}

    def note_unused(self) -> None:
        """Note values of connectors of systems that arrive nowhere."""
        for node in self.given:
            if node[0] not in self.descriptions and node not in self.reached:
                name = shown(".".join((*node[0], node[1])))
                self.notes.append(f"{self.given[node].place}: `{name}` is connected to no component, and left out.")

    def way(self, node: Node) -> Way | None:
        """Where an input gets its value from."""
        way = self.wiring.way(node, self.units_of_variables, self.given)
        if way:
            self.reached.add(way.source)
        return way

    def through(self, way: Way, variable: Variable) -> Value | None:
        """Value of a connector of a system, as it arrives at a variable."""
        unit = self.wiring.connectors[way.source].unit
        value = self.valued(way.source, unit or variable.unit or "")
        return value if value is None else converted(value, way.line)

    def valued(self, node: Node, unit: str) -> Value | None:
        """Value that is given to a node, in some unit, or None."""
        given = self.given.get(node)
        if given is None:
            return None
        line: Line | None = Line()
        if given.unit and unit and not given.suppress:
            line = conversion(given.unit, unit, {**self.units, **given.units})
        if line is None:
            said = f"it is in `{shown(given.unit)}`, `{unit}` is expected, and there is no conversion"
            self.problems.append(f"{given.place}: {said}. Define both units, or correct one.")
        return converted(given.value, (line or Line()).then(given.line))

    def refuse_strange_ends(self) -> None:
        """Note connections to what an FMU does not have; the check of the scenario sees the other ends."""
        for path, connector in self.wiring.edges:
            if path in self.descriptions and connector not in self.descriptions[path].variables:
                known = suggest(connector, self.descriptions[path].variables)
                self.problems.append(f"{self.names[path]}: its FMU has no `{shown(connector)}`. {known}")


def converted(value: Value, line: Line) -> Value:
    """A value after a line; what is no number has none."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return line.of(float(value)) if is_number and line != Line() else value


def plain_names(paths: list[Path]) -> dict[Path, str]:
    """A name for each component that a scenario may have, the names of its systems before its own."""
    names: dict[Path, str] = {}
    for path in paths:
        first = re.sub(r"\W", "_", "_".join(path), flags=re.ASCII)
        first = first if re.match("[A-Za-z_]", first) else f"c_{first}"
        taken, tries = set(names.values()), (f"{first}{f'_{k}' if k else ''}" for k in range(len(paths) + 1))
        names[path] = next(name for name in tries if name not in taken)
    return names
