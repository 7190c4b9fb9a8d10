"""Make a scenario of a system structure package: a folder with `scenario.toml` and its FMUs."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Collection, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element as Xml
from xml.etree.ElementTree import ParseError

from gapsense._os.files import finite
from gapsense.cosim.check import check, describe_fmu
from gapsense.cosim.fmu.archive import UnusableError, sanitise
from gapsense.cosim.fmu.descriptions import Description, Variable
from gapsense.cosim.scenario.build import write_document
from gapsense.cosim.scenario.read import Document
from gapsense.parameters import is_file
from gapsense.problems import InputError, listing, suggest
from gapsense.ssp.carried import OF_COMPONENTS, OF_CONNECTIONS, WHOLE
from gapsense.ssp.package import Package, open_package
from gapsense.ssp.structure import SINKS, Connector, Element, Link, Place, read_element
from gapsense.ssp.units import Line, Units, conversion, read_units, together, units_of
from gapsense.ssp.values import BindingReader, Node
from gapsense.ssp.words import DESCRIPTION, OSP, OWN, number_names, tag
from gapsense.tables import Value, is_number

FMUS, FILES = "fmus", "files"  # folders beside the scenario


def bring(
    path: Path, folder: Path, base_step: float | None = None, stop: float | None = None, method: str | None = None
) -> list[str]:
    """Write the scenario of a package to a new folder, complete or not at all.

    Base step and end of the run [s] are needed where the package does not tell them, or something else is wanted. The
    method is by default what our annotation tells, and without one `jacobi`. Answers with a sentence on each thing of
    the package that was left out or taken for granted. An InputError has everything that is wrong with it or not
    supported.
    """
    if folder.exists():
        raise InputError([f"`{folder}` exists already. Choose another name, or remove it."])
    partial = folder.with_name(f".{folder.name}.part")
    problems: list[str] = []
    notes: list[str] = []
    shutil.rmtree(partial, ignore_errors=True)  # what a kill left
    try:
        (partial / FMUS).mkdir(parents=True)
        with open_package(path) as package:
            data = build_tables(package, partial, problems, notes, base_step=base_step, stop=stop, method=method)
        refuse(path, problems)
        write_document(Document(partial / "scenario.toml", data), partial / "scenario.toml")
        refuse(path, check(partial, fmus=partial / FMUS))
        partial.rename(folder)
    finally:  # complete or absent
        shutil.rmtree(partial, ignore_errors=True)
    return list(dict.fromkeys(notes))


def refuse(path: Path, problems: list[str]) -> None:
    """Raise an InputError with all problems, if there are any."""
    if problems:
        raise InputError([f"{path.name}: {problem}" for problem in problems])


def build_tables(
    package: Package, folder: Path, problems: list[str], notes: list[str], **options: Any
) -> dict[str, Any]:
    """Build the tables of the scenario; FMUs and other files go into its folder. Incomplete if there are problems."""
    root, outer = read_structure(package, problems, notes)
    maker = Maker(package=package, root=root, outer=outer, folder=folder, problems=problems, notes=notes)
    experiment = maker.told.experiment(**options)
    problems += [] if maker.components else ["there is no component in it. Add one."]
    if problems:
        return {}
    data = maker.make_tables(root.get("name", "") or package.path.stem, experiment)
    take_files(package, data, folder)
    return data


def read_structure(package: Package, problems: list[str], notes: list[str]) -> tuple[Xml, Element]:
    """The document and its outermost system."""
    try:
        root, violations = package.document(DESCRIPTION, "ssd")
        system, version = root.find(tag("ssd:System")), root.get("version", "")
        if system is None or not version.startswith("1."):
            raise UnusableError(
                f"it is of SSP `{sanitise(version)}`, a system of SSP 1.0 is expected. Export it as that."
            )
        notes += [f"{DESCRIPTION} is not as the schema says: {text}" for text in violations]
        return root, read_element(system, (), problems)
    except (ParseError, ValueError) as error:
        raise InputError([f"{package.path}: {error}"]) from error


def take_fmus(
    package: Package, components: list[Element], folder: Path, problems: list[str]
) -> tuple[dict[Place, str], dict[Place, Description]]:
    """Put the FMU of each component into the folder of FMUs: its file there, and what it says, if it can be read."""
    files: dict[str, str] = {}
    wrong: dict[str, str] = {}
    out: dict[Place, str] = {}
    descriptions: dict[Place, Description] = {}
    for one in components:
        try:
            member = package.member(one.source)
        except UnusableError as error:
            problems.append(f"{one.name}: {error}")
            continue
        if member not in files:
            files[member] = fresh(f"{PurePosixPath(member).stem}.fmu", set(files.values()))
            package.copy(member, folder / FMUS / files[member])
        out[one.path] = f"{FMUS}/{files[member]}"
        if member not in wrong:
            try:
                descriptions[one.path] = describe_fmu(folder / out[one.path])
            except UnusableError as error:
                wrong[member] = f"{one.name}, `{sanitise(one.source)}`: it cannot be used: {error}"
    problems += wrong.values()
    return out, descriptions


def fresh(name: str, taken: set[str]) -> str:
    """A file name that none of the others has, whatever the case of its letters."""
    others, path = {other.lower() for other in taken}, PurePosixPath(name)
    return next(name for name in number_names(path.stem, path.suffix) if name.lower() not in others)


def take_files(package: Package, data: Mapping[str, Any], folder: Path) -> None:
    """Put files that parameters name into the folder, if they are in the package."""
    taken: dict[str, str] = {}
    for component in data["components"].values():
        for name, value in component.get("set", {}).items():
            if is_file(name, value) and value in package.names:
                (folder / FILES).mkdir(exist_ok=True)
                if value not in taken:
                    taken[value] = fresh(PurePosixPath(value).name, set(taken.values()))
                    package.copy(value, folder / FILES / taken[value])
                component["set"][name] = f"{FILES}/{taken[value]}"


# The tables of the scenario, made of what the package says.


if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

JACOBI = "jacobi"  # what tools of SSP do where nothing else is told
SIGNAL = ("times", "values", "interpolation")
ZERO: Mapping[str, Value] = {"Real": 0.0, "Boolean": False, "String": ""}


class Maker:
    """Makes the sections of a scenario; `problems` and `notes` take what is wrong, and what is left out."""

    def __init__(
        self, package: Package, root: Xml, outer: Element, folder: Path, problems: list[str], notes: list[str]
    ) -> None:
        self.problems, self.notes = problems, notes
        self.told, self.components = Told(root, problems, notes), [*outer.components()]
        self.fmus, self.descriptions = take_fmus(package, self.components, folder, problems)
        files = dict.fromkeys(d.path for d in self.descriptions.values())
        shared, other = together(map(units_of, files))
        problems += [f"the unit `{sanitise(name)}` is not the same in two FMUs. Correct one of them." for name in other]
        own = read_units(root, f"{tag('ssd:Units')}/{tag('ssc:Unit')}")
        self.units = {**shared, **own}  # those of the document go before
        known = {path: d.variables for path, d in self.descriptions.items()}
        reader = BindingReader(package=package, units=self.units, known=known, problems=problems, notes=notes)
        reader.read(outer)
        reader.finish()
        self.given, self.wiring = reader.given, Wiring(outer, self.units, problems)
        every = ((path, v) for path, own in known.items() for v in own.values())
        self.units_of_variables = {(path, v.name): v.unit or "" for path, v in every}  # as the FMUs state them
        self.names = plain_names([one.path for one in self.components])
        self.connect: dict[str, str] = {}
        self.connections: list[dict[str, Any]] = []
        self.inputs: dict[str, Any] = {}
        self.seeds: dict[str, Value] = {}
        self.idle: list[str] = []
        self.reached: set[Node] = set()  # where values come from

    def make_tables(self, title: str, experiment: Mapping[str, Any]) -> dict[str, Any]:
        """Make the tables of the scenario."""
        renamed = ((one.name, self.names[one.path]) for one in self.components)
        self.notes += [f"`{name}` is called `{new}`." for name, new in renamed if name != new]
        base = experiment.get("base_step")
        components = {self.names[one.path]: self.component(one, base) for one in self.components}
        for path, connector in self.wiring.edges:  # the check of the scenario sees the other ends
            if path in self.descriptions and connector not in (known := self.descriptions[path].variables):
                found = f"its FMU has no `{sanitise(connector)}`"
                self.problems.append(f"{self.names[path]}: {found}. {suggest(connector, known)}")
        for node in self.given:
            if node[0] not in self.descriptions and node not in self.reached:
                left = f"`{name_of(node)}` is connected to no component, and left out"
                self.notes.append(f"{self.given[node].place}: {left}.")
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
        value = self.through(way, variable) if way else self.find_value(node, variable.unit or "")
        if value is None:
            self.idle.append(target)
            value = ZERO.get(variable.type, 0) if variable.start is None else variable.start
        self.inputs[target] = value

    def link(self, way: Way, target: str, variable: Variable) -> None:
        """Connection to an input."""
        path, output = way.source
        source = f"{self.names[path]}.{output}"
        own = self.told.links().get((source, target), {})
        gives = self.descriptions[path].variables.get(output)
        is_other = bool(gives and gives.unit and variable.unit and gives.unit != variable.unit)
        if way.line == Line() and not is_other and not own:
            self.connect[target] = source
            return
        converts = {"factor": way.line.factor, "bias": way.line.offset} if way.line != Line() or is_other else {}
        unit = {"unit": variable.unit} if converts and variable.unit else {}
        self.connections.append({"from": source, "to": target, **converts, **unit, **own})

    def parameter(self, node: Node, variable: Variable) -> Value | None:
        """Value of a parameter or another variable that has a start value, or None if it keeps its own."""
        way = self.way(node) if node in self.wiring.edges else None
        if way and way.source[0] in self.descriptions:
            name = ".".join((self.names[node[0]], variable.name))
            self.problems.append(
                f"{name}: it is connected to `{sanitise(way.source[1])}`, only inputs may be connected. Set a value."
            )
            return None
        value = self.through(way, variable) if way else self.find_value(node, variable.unit or "")
        return None if value == variable.start and not variable.is_settable else value

    def way(self, node: Node) -> Way | None:
        """Where an input gets its value from."""
        if way := self.wiring.way(node, self.units_of_variables, self.given):
            self.reached.add(way.source)
        return way

    def through(self, way: Way, variable: Variable) -> Value | None:
        """Value of a connector of a system, as it arrives at a variable."""
        unit = self.wiring.connectors[way.source].unit
        value = self.find_value(way.source, unit or variable.unit or "")
        return value if value is None else convert_value(value, way.line)

    def find_value(self, node: Node, unit: str) -> Value | None:
        """Find the value that is given to a node, in some unit, or None."""
        if (given := self.given.get(node)) is None:
            return None
        line: Line | None = Line()
        if given.unit and unit and not given.suppress:
            line = conversion(given.unit, unit, {**self.units, **given.units})
        if line is None:
            said = f"it is in `{sanitise(given.unit)}`, `{unit}` is expected, and there is no conversion"
            self.problems.append(f"{given.place}: {said}. Define both units, or correct one.")
        return convert_value(given.value, (line or Line()).then(given.line))


def convert_value(value: Value, line: Line) -> Value:
    """Apply a line to a value; what is no number stays."""
    return line.of(float(value)) if is_number(value) and line != Line() else value


def plain_names(paths: list[Place]) -> dict[Place, str]:
    """A name for each component that a scenario may have, the names of its systems before its own."""
    names: dict[Place, str] = {}
    for path in paths:
        first = re.sub(r"\W", "_", "_".join(path), flags=re.ASCII)
        first = first if re.match("[A-Za-z_]", first) else f"c_{first}"
        taken = set(names.values())
        names[path] = next(name for name in number_names(first) if name not in taken)
    return names


# What a package tells about a run: start and stop, steps, and in our own annotation what SSP has no words for.


class Told:
    """What the document says on the run; `problems` and `notes` take what is wrong, and what is left out."""

    def __init__(self, root: Xml, problems: list[str], notes: list[str]) -> None:
        self.root, self.problems, self.notes = root, problems, notes
        self.own = self.read_own()
        kinds = dict.fromkeys(xml.get("type", "") for xml in root.iter(tag("ssc:Annotation")))
        for kind in (kind for kind in kinds if kind not in (OWN, OSP)):
            notes.append(f"annotations of `{sanitise(kind)}` are left out, but for a step in them.")

    def read_own(self) -> dict[str, Any]:
        """Tables of our annotation, but for what SSP itself tells."""
        if (found := self.root.find(f"{tag('ssd:DefaultExperiment')}//{tag('gapsense:Scenario')}")) is None:
            return {}
        try:
            data = tomllib.loads(found.text or "")
        except ValueError as error:
            self.problems.append(f"annotation `{OWN}`: not valid TOML: {error}. Export it again, or remove it.")
            return {}
        return {key: value for key, value in data.items() if isinstance(value, (dict, list)) or key in WHOLE}

    def table(self, key: str) -> dict[str, Any]:
        """A table of our annotation; empty if there is none."""
        found = self.own.get(key)
        return found if isinstance(found, dict) else {}

    def experiment(self, **options: Any) -> dict[str, Any]:
        """The section `[experiment]`: options go before the document, and that before our annotation."""
        xml = self.root.find(tag("ssd:DefaultExperiment"))
        times = {} if xml is None else {"start": xml.get("startTime"), "stop": xml.get("stopTime")}
        read = {key: number for key, text in times.items() if text and (number := finite(text)) is not None}
        steps = {} if (step := self.step()) is None else {"base_step": step}
        made = {"start": 0.0, **steps, "method": JACOBI, **self.table("experiment"), **read}
        made |= {key: value for key, value in options.items() if value is not None}
        for key, option in (("stop", "--stop"), ("base_step", "--step")):
            if key not in made:
                self.problems.append(f"experiment: the package does not give `{key}`. Give it with `{option}`.")
        if "method" not in self.table("experiment") and options.get("method") is None:
            self.notes.append(f"experiment.method: SSP does not describe the coupling; `{JACOBI}` is used.")
        return made

    def step(self) -> float | None:
        """Base step that annotations of other tools tell [s]: that of OSP, or else the least of OMSimulator."""
        names = {"FixedStepAlgorithm": "baseStepSize", "FixedStepMaster": "stepSize"}
        for name, key in names.items():
            told = (finite(xml.get(key, "")) for xml in self.root.iter() if xml.tag.rpartition("}")[2] == name)
            if steps := [step for step in told if step is not None and step > 0.0]:
                return min(steps)
        return None

    def component(self, name: str, xml: Xml, base_step: float | None) -> dict[str, Any]:
        """Step, offset and process of a component, where they are not as usual."""
        hints = (one.get("value", "") for one in xml.iter(tag("osp:StepSizeHint")))
        hint = next((step for text in hints if (step := finite(text)) is not None), None)
        own = self.table("components").get(name)
        made = {key: own[key] for key in OF_COMPONENTS if key in own} if isinstance(own, dict) else {}
        if hint is None or not base_step or "step" in made:
            return made
        ratio = hint / base_step
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
            self.notes.append(
                f"{name}: its step of {hint:.9g} s is not a multiple of {base_step:.9g} s, and is left out."
            )
        elif round(ratio) > 1:
            made["step"] = round(ratio)
        return made

    def signals(self) -> dict[str, dict[str, Any]]:
        """Signals that inputs follow."""
        found = {name: one for name, one in self.table("inputs").items() if isinstance(one, dict)}
        return {name: {key: one[key] for key in SIGNAL if key in one} for name, one in found.items()}

    def links(self) -> dict[tuple[str, str], dict[str, bool]]:
        """What connections are beside their source and target: delayed, or means."""
        links = self.own.get("connections")
        found = [link for link in links if isinstance(link, dict)] if isinstance(links, list) else []
        return {
            (str(link.get("from")), str(link.get("to"))): own
            for link in found
            if (own := {key: True for key in OF_CONNECTIONS if link.get(key) is True})
        }

    def rest(self) -> Mapping[str, Any]:
        """Events, record, metrics and what a page shows."""
        return {
            key: self.own[key] for key in ("events", "record", "metrics", "page") if isinstance(self.own.get(key), dict)
        }


# Nested systems as one level: each input of a component is followed back to where its value comes from.


def name_of(node: Node) -> str:
    """A connector or a variable, as messages name it."""
    return sanitise(".".join((*node[0], node[1])))


class Way(NamedTuple):
    """Where an input of a component gets its value from, and what becomes of it."""

    source: Node
    line: Line


class Wiring:
    """Connections of a whole structure; `problems` takes what is wrong with them."""

    def __init__(self, root: Element, units: Units, problems: list[str]) -> None:
        self.units, self.problems = units, problems
        self.connectors: dict[Node, Connector] = {}
        self.components: set[tuple[str, ...]] = set()
        self.edges: dict[Node, tuple[Node, Link]] = {}  # where a connector gets its value from
        self.add(root)

    def add(self, element: Element) -> None:
        """Connectors and connections of an element and all below it."""
        self.connectors |= {(element.path, name): connector for name, connector in element.connectors.items()}
        if element.is_component:
            self.components.add(element.path)
        for inner in element.elements.values():
            self.add(inner)
        for link in element.links:
            self.connect(element, link)

    def connect(self, system: Element, link: Link) -> None:
        """Add a connection in the direction that the kinds of its connectors tell."""
        place = " -> ".join(sanitise(".".join(filter(None, end))) for end in link.ends)
        ends = [self.end(system, *end) for end in link.ends]
        if link.refused:
            self.problems.append(f"{system.name}, {place}: `{link.refused}` is not supported. Remove it.")
        elif None in ends:
            self.problems.append(f"{system.name}, {place}: there is no such connector. Correct the connection.")
        else:
            (one, gives), (other, other_gives) = (end for end in ends if end)
            if gives == other_gives:
                self.problems.append(
                    f"{system.name}, {place}: both ends {'give' if gives else 'take'} a value. Correct it."
                )
            else:
                source, sink = (one, other) if gives else (other, one)
                if sink in self.edges:
                    self.problems.append(f"{system.name}, {place}: `{name_of(sink)}` is connected twice. Keep one.")
                self.edges.setdefault(sink, (source, link))

    def end(self, system: Element, element: str, connector: str) -> tuple[Node, bool] | None:
        """An end of a connection, and whether it gives a value; a system's own input gives it to those inside."""
        owner = system.elements.get(element) if element else system
        found = owner.connectors.get(connector) if owner else None
        if owner is None or found is None:
            return None
        return (owner.path, connector), (found.kind in SINKS) == (owner is system)

    def way(self, sink: Node, units: Mapping[Node, str], given: Collection[Node]) -> Way | None:
        """Where an input of a component gets its value from, or None if nothing is connected to it.

        That is an output of a component, or an outermost connector of a system on the way, which is `given` a value.
        `units` has the units of the variables of components; they take precedence over those of the structure.
        """
        steps: list[tuple[Node, Link]] = []
        node = sink
        while node in self.edges and len(steps) <= len(self.edges):
            source, link = self.edges[node]
            steps.append((node, link))
            node = source
            if node[0] in self.components:
                break
        while steps and node not in given and node[0] not in self.components:
            node = steps.pop()[0]
        return Way(node, self.line(node, steps, units)) if steps else None

    def line(self, source: Node, steps: list[tuple[Node, Link]], units: Mapping[Node, str]) -> Line:
        """What becomes of a value on its way from the source to the sink."""
        made, unit = Line(), units.get(source) or self.connectors[source].unit
        for node, link in reversed(steps):
            own = units.get(node) or self.connectors[node].unit
            if unit and own and unit != own and not link.suppress:
                if (found := conversion(unit, own, self.units)) is None:
                    said = f"`{name_of(node)}` is in `{sanitise(own)}`, what it gets is in `{sanitise(unit)}`"
                    self.problems.append(f"{said}, and there is no conversion. Define both units, or correct one.")
                made = made.then(found or Line())
            made, unit = made.then(link.line), own or unit
        return made
