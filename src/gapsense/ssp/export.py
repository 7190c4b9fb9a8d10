"""Export a scenario as SSP 1.0."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from gapsense._os.files import write_atomically
from gapsense.cosim.check import prepare
from gapsense.cosim.fmu.descriptions import Description, Variable
from gapsense.cosim.scenario.read import Source, document_of
from gapsense.cosim.scenario.records import Connection, Port, Scenario
from gapsense.parameters import is_file
from gapsense.problems import InputError, ScenarioError, listing
from gapsense.ssp import carried
from gapsense.ssp.package import violations
from gapsense.ssp.units import EXPONENTS, Units, together, units_of
from gapsense.ssp.words import DESCRIPTION, FMU_TYPE, OSP, OWN, PREFIXES, VALUES, VERSION, number_names, tag
from gapsense.tables import Value

DATE = (1980, 1, 1, 0, 0, 0)  # of all members, so that the same scenario gives the same bytes
UNUSUAL = ("String", "Enumeration")  # types that some tools refuse: listed where they are connected only
Values = list[tuple[Variable, Value]]


@dataclass(frozen=True)
class Exported:
    """A scenario, and what of it has which name in the archive."""

    scenario: Scenario
    descriptions: Mapping[str, Description]
    data: Mapping[str, Any]  # for the annotation

    @cached_property
    def sources(self) -> dict[Path, str]:
        """Name in the archive of each FMU file; two files of one name get a number."""
        names: dict[Path, str] = {}
        for path in (d.path.resolve() for d in self.descriptions.values()):
            tries, taken = number_names(f"resources/{path.stem}", ".fmu"), set(names.values())
            names.setdefault(path, next(name for name in tries if name not in taken))
        return names

    @cached_property
    def files(self) -> dict[Path, str]:
        """Name in the archive of each other file that a parameter names."""
        named = (v for c in self.scenario.components.values() for n, v in c.values.items() if is_file(n, v))
        paths = dict.fromkeys(Path(str(value)).resolve() for value in named)
        return {path: f"resources/{k}_{path.name}" for k, path in enumerate(paths, 1)}

    @cached_property
    def units(self) -> Units:
        """Definitions of units."""
        return together(units_of(d.path.resolve()) for d in self.descriptions.values())[0]

    @cached_property
    def connected(self) -> set[Port]:
        """Ports with a connection."""
        return {port for link in self.scenario.connections for port in (link.source, link.target)}

    def connectors(self, name: str) -> list[Variable]:
        """Variables of a component that are listed: connected inputs, and outputs."""
        own = self.descriptions[name]
        inputs = [v for v in own.of("input") if Port(name, v.name) in self.connected]
        outputs = [v for v in own.of("output") if v.type not in UNUSUAL or Port(name, v.name) in self.connected]
        return [*inputs, *outputs]

    def values(self, name: str) -> Values:
        """Values that a component gets before its initialisation: parameters, constant inputs, its seed."""
        scenario, variables = self.scenario, self.descriptions[name].variables
        given: dict[str, Value] = {**scenario.components[name].values}
        given |= {"seed": scenario.seeds[name]} if name in scenario.seeds else {}
        given |= {port.variable: value for port, value in scenario.inputs.items() if port.component == name}
        first = {p.variable: float(s.values[0]) for p, s in scenario.played.items() if p.component == name}
        given |= {n: value if variables[n].type == "Real" else int(value) for n, value in first.items()}
        files = {n: self.files[Path(str(value)).resolve()] for n, value in given.items() if is_file(n, value)}
        return [(variables[n], files.get(n, value)) for n, value in given.items()]


def export(source: Source, path: Path, variant: str | None = None, fmus: str | Path | None = None) -> list[str]:
    """Write a scenario as SSP 1.0 to a file with the ending `.ssp`, complete or not at all.

    Answers with a sentence on each thing that other tools will not see, or that is left out. A ScenarioError has
    everything that SSP 1.0 cannot hold.
    """
    if path.suffix != ".ssp":
        raise InputError([f"`{path}`: a system structure package has the ending .ssp. Change the ending."])
    scenario, descriptions = prepare(source, variant, fmus)
    document = document_of(source, variant)
    made = Exported(scenario, descriptions, carried.collect_tables(scenario, document))
    if problems := [f"{scenario.path.name}, {problem}" for problem in refusals(made)]:
        raise ScenarioError(problems)
    every = parameter_set(scenario.name, changed_values(made))  # in one set, for tools that read only one
    members = {DESCRIPTION: description(made), VALUES: serialise(every)}
    if wrong := [*violations(members[DESCRIPTION], "ssd"), *violations(members[VALUES], "ssv")]:
        raise ScenarioError([f"{scenario.path.name}: not valid as SSP 1.0: {line}" for line in wrong])
    write_atomically(path, lambda file: pack(file.buffer, members, {**made.sources, **made.files}))
    return [*carried.notes(scenario, document.data), *notes(made)]


def refusals(made: Exported) -> Iterator[str]:
    """What SSP 1.0 cannot hold, one sentence each."""
    for name, own in made.descriptions.items():
        if own.fmi != 2:
            yield f"components.{name}.fmu: it is of FMI 3.0, SSP 1.0 knows FMI 2.0. Export an FMU of that."
        for variable, value in made.values(name):
            if isinstance(value, str) and not all(c.isprintable() or c in "\n\t" for c in value):
                yield f"components.{name}: `{variable.name}` has characters that XML cannot hold. Remove them."
    for unit in together(units_of(d.path.resolve()) for d in made.descriptions.values())[1]:
        yield f"components: the unit `{unit}` is not the same in two FMUs. Correct one of them."


def notes(made: Exported) -> Iterator[str]:
    """One sentence on each thing that some tools do not take."""
    every = [(f"{name}.{v.name}", v) for name in made.descriptions for v in made.connectors(name)]
    if undefined := [name for name, v in every if v.unit and v.unit not in made.units]:
        yield f"units of {listing(undefined)}: their FMUs do not define them, and they are left out."
    if converted := [str(link.target) for link in made.scenario.connections if link.converts]:
        yield f"conversion to {listing(converted)}: it is in the package, but some tools, fmpy among them, ignore it."
    values = [*changed_values(made)]
    if texts := [name for name, v, _ in values if v.type in UNUSUAL]:
        yield f"values of {listing(texts)}: `simulate_ssp` of fmpy sets no texts; see docs/ssp.md."
    if switches := [name for name, _, value in values if value is False]:
        yield f"values of {listing(switches)}: `simulate_ssp` of fmpy sets true in place of false; see docs/ssp.md."
    names = list(made.scenario.components)
    if confused := [b for a in names for b in names if a != b and b.startswith(a)]:
        yield f"values of {listing(confused)}: fmpy confuses components of which one name begins with the other."
    for path in made.files:
        yield f"`{path.name}` is in the package, where only Gapsense finds it on import."


def description(made: Exported) -> bytes:
    """The system structure."""
    scenario = made.scenario
    root = Element(tag("ssd:SystemStructureDescription"), {"version": VERSION, "name": scenario.name})
    system = add(root, "ssd:System", {"name": scenario.called, "description": scenario.title})
    elements = add(system, "ssd:Elements")
    for name in scenario.components:
        add_component(elements, made, name)
    if scenario.connections:
        links = add(system, "ssd:Connections")
    for link in scenario.connections:
        units = {made.descriptions[port.component].variables[port.variable].unit for port in (link.source, link.target)}
        add_connection(links, link, len(units) > 1)
    every = [(name, v) for name in scenario.components for v in made.connectors(name)]
    add_enumerations(root, {f"{name}.{v.name}": v.items for name, v in every if v.type == "Enumeration"})
    add_units(root, [v.unit for _, v in every if v.unit], made.units)
    add_experiment(root, made)
    return serialise(root)


def add_component(parent: Element, made: Exported, name: str) -> None:
    """One component with its connectors, its values and its step."""
    source = made.sources[made.descriptions[name].path.resolve()]
    about = {"name": name, "type": FMU_TYPE, "source": source, "implementation": "CoSimulation"}
    component = add(parent, "ssd:Component", about)
    if listed := made.connectors(name):
        connectors = add(component, "ssd:Connectors")
    for variable in listed:
        add_connector(connectors, variable, made.units, f"{name}.{variable.name}")
    if values := [(v.name, v, value) for v, value in made.values(name)]:
        binding = add(add(component, "ssd:ParameterBindings"), "ssd:ParameterBinding")
        add(binding, "ssd:ParameterValues").append(parameter_set(name, values))
    step = made.scenario.components[name].step * made.scenario.experiment.base_step
    add_annotation(component, OSP, Element(tag("osp:StepSizeHint"), {"value": repr(step)}))


def add_experiment(root: Element, made: Exported) -> None:
    """Start, stop and base step, and in our annotation all that SSP has no words for."""
    import tomli_w

    experiment = made.scenario.experiment
    times = {"startTime": repr(experiment.start), "stopTime": repr(experiment.stop)}
    around = add(root, "ssd:DefaultExperiment", times)
    algorithm = Element(tag("osp:Algorithm"))
    add(algorithm, "osp:FixedStepAlgorithm", {"baseStepSize": repr(experiment.base_step)})
    add_annotation(around, OSP, algorithm)
    own = Element(tag("gapsense:Scenario"))
    own.text = tomli_w.dumps(made.data)
    add_annotation(around, OWN, own)


def changed_values(made: Exported) -> Iterator[tuple[str, Variable, Value]]:
    """Values by `component.variable` that differ from the start values of the FMU."""
    for name in made.scenario.components:
        yield from ((f"{name}.{v.name}", v, value) for v, value in made.values(name) if v.number(value) != v.start)


def pack(file: Any, members: Mapping[str, bytes], sources: Mapping[Path, str]) -> None:
    """The archive: documents, then FMUs and other files."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        files = ((name, path.read_bytes()) for path, name in sources.items())  # one at a time
        for name, content in chain(members.items(), files):
            method = zipfile.ZIP_STORED if name.endswith(".fmu") else zipfile.ZIP_DEFLATED  # an FMU is compressed
            archive.writestr(zipfile.ZipInfo(name, DATE), content, method)


# Documents of SSP as XML: components, connectors, connections, values.


def add(parent: Element, name: str, attributes: Mapping[str, Any] | None = None) -> Element:
    """A new element below another; attributes that are None are left out."""
    given = {key: str(value) for key, value in (attributes or {}).items() if value is not None}
    return SubElement(parent, tag(name), given)


def serialise(root: Element) -> bytes:
    """Write a document as text, with the usual prefixes: some tools know nothing but these."""
    for prefix, uri in PREFIXES.items():
        register_namespace(prefix, uri)
    indent(root)
    text = tostring(root, "unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def add_connector(parent: Element, variable: Variable, units: Units, enumeration: str) -> None:
    """A connector for a variable, with its type and, if that is defined, its unit."""
    made = add(parent, "ssd:Connector", {"name": variable.name, "kind": variable.causality})
    if variable.type == "Real":
        add(made, "ssc:Real", {"unit": variable.unit if variable.unit in units else None})
    else:
        add(made, f"ssc:{variable.type}", {"name": enumeration} if variable.type == "Enumeration" else None)


def add_connection(parent: Element, link: Connection, is_other_unit: bool) -> None:
    """A connection. If its factor converts the unit, other tools must not convert it again."""
    ends = ("start", link.source), ("end", link.target)
    names = {f"{end}{kind}": name for end, port in ends for kind, name in zip(("Element", "Connector"), port)}
    suppress = "true" if link.converts and is_other_unit else None
    made = add(parent, "ssd:Connection", {**names, "suppressUnitConversion": suppress})
    if link.converts:
        factor = 1.0 if link.factor is None else float(link.factor)
        add(made, "ssc:LinearTransformation", {"factor": repr(factor), "offset": repr(float(link.bias or 0.0))})


def parameter_set(name: str, values: Iterable[tuple[str, Variable, Value]]) -> Element:
    """Values with their types."""
    made = Element(tag("ssv:ParameterSet"), {"version": VERSION, "name": name})
    inside = add(made, "ssv:Parameters")
    for called, variable, value in values:
        one = add(inside, "ssv:Parameter", {"name": called})
        add(one, f"ssv:{variable.type}", {"value": text_of(value, variable)})
    return made


def text_of(value: Value, variable: Variable) -> str:
    """A value as SSP writes it: numbers read back to the same bits, an enumeration has the name of its item."""
    if variable.type == "Real":
        return repr(float(value))
    if variable.type == "Boolean":
        return "true" if value else "false"
    if variable.type == "Enumeration":
        return next((name for name, number in variable.items.items() if number == value), str(value))
    return str(value)


def add_units(parent: Element, names: Iterable[str], units: Units) -> None:
    """Definitions of the units that are used."""
    if used := sorted({name for name in names if name in units}):
        made = add(parent, "ssd:Units")
    for name in used:
        base = units[name]
        powers = {key: power for key, power in zip(EXPONENTS, base.exponents) if power}
        line = {
            key: repr(x) for key, x, usual in (("factor", base.factor, 1.0), ("offset", base.offset, 0.0)) if x != usual
        }
        add(add(made, "ssc:Unit", {"name": name}), "ssc:BaseUnit", {**powers, **line})


def add_enumerations(parent: Element, items: Mapping[str, Mapping[str, int]]) -> None:
    """Definitions of the enumerations that are used."""
    if items:
        made = add(parent, "ssd:Enumerations")
    for name, own in items.items():
        one = add(made, "ssc:Enumeration", {"name": name})
        for item, number in own.items():
            add(one, "ssc:Item", {"name": item, "value": number})


def add_annotation(parent: Element, kind: str, content: Element) -> None:
    """An annotation beside those that there are."""
    found = parent.find(tag("ssd:Annotations"))
    around = add(parent, "ssd:Annotations") if found is None else found
    add(around, "ssc:Annotation", {"type": kind}).append(content)
