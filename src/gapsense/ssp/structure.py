"""The system structure as it stands in a package: elements, connectors, connections."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.etree.ElementTree import Element as Xml

from gapsense.cosim.fmu.archive import UnusableError, sanitise
from gapsense.ssp.units import Line
from gapsense.ssp.words import FMU_TYPE, TYPES, plain, tag

Place = tuple[str, ...]  # of an element: names from the outermost system on, without that
SOURCES, SINKS = ("output", "calculatedParameter"), ("input", "parameter")
DEEPEST = 50  # levels of systems
REFUSED = {"ssd:SignalDictionaryReference": "a signal dictionary"}  # elements that nothing is made of


class Connector(NamedTuple):
    """Connector of an element: its kind, and its unit where that is told."""

    kind: str
    unit: str = ""


class Link(NamedTuple):
    """Connection between two connectors of a system or its elements; an element's name is empty for the system."""

    ends: tuple[tuple[str, str], tuple[str, str]]
    line: Line
    suppress: bool  # no conversion of units
    refused: str = ""  # a transformation that nothing is made of


@dataclass
class Element:
    """A system or a component with what belongs to it."""

    path: Place
    xml: Xml
    connectors: dict[str, Connector] = field(default_factory=dict)
    elements: dict[str, Element] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    source: str = ""  # of a component

    @property
    def is_component(self) -> bool:
        """True for a component, false for a system."""
        return bool(self.source)

    @property
    def name(self) -> str:
        """As messages name it."""
        return sanitise(".".join(self.path)) or "the system"

    def components(self) -> Iterator[Element]:
        """All components in it at any depth, in the order of the document."""
        if self.is_component:
            yield self
        for element in self.elements.values():
            yield from element.components()


def read_element(xml: Xml, path: Place, problems: list[str]) -> Element:
    """An element of a system structure; `problems` takes what cannot be used."""
    if len(path) > DEEPEST:
        raise UnusableError(f"systems are nested more than {DEEPEST} deep. Connect them at fewer levels.")
    made = Element(path, xml)
    for one in xml.iterfind(f"{tag('ssd:Connectors')}/{tag('ssd:Connector')}"):
        name, kind = one.get("name", ""), one.get("kind", "")
        typed = next((child for child in one if plain(child.tag).removeprefix("ssc:") in TYPES), None)
        made.connectors[name] = Connector(kind, "" if typed is None else typed.get("unit", ""))
        if kind not in (*SOURCES, *SINKS):
            problems.append(f"{made.name}: its connector `{sanitise(name)}` is of kind {sanitise(kind)}.")
    if xml.tag == tag("ssd:Component"):
        made.source = xml.get("source", "") or "?"
        problems += refused_component(xml, made)
        return made
    for one in xml.iterfind(f"{tag('ssd:Elements')}/*"):
        name = one.get("name", "")
        if plain(one.tag) not in ("ssd:Component", "ssd:System"):
            what = REFUSED.get(plain(one.tag), f"an element `{sanitise(plain(one.tag))}`")
            problems.append(f"{made.name}: `{sanitise(name)}` is {what}, which is not supported. Connect it directly.")
        elif name in made.elements:
            problems.append(f"{made.name}: there are two elements `{sanitise(name)}`. Rename one.")
        else:
            made.elements[name] = read_element(one, (*path, name), problems)
    made.links = [read_link(one) for one in xml.iterfind(f"{tag('ssd:Connections')}/{tag('ssd:Connection')}")]
    return made


def refused_component(xml: Xml, made: Element) -> Iterator[str]:
    """Why a component cannot be used, one sentence each."""
    kind, implementation = xml.get("type", FMU_TYPE) or FMU_TYPE, xml.get("implementation", "any")
    if kind != FMU_TYPE:
        yield f"{made.name}: it is of type `{sanitise(kind)}`, `{FMU_TYPE}` expected. Put its content into this system."
    if implementation == "ModelExchange":
        yield f"{made.name}: its implementation is ModelExchange, CoSimulation expected. Export the FMU as that."


def read_link(xml: Xml) -> Link:
    """A connection; the ends are in no order."""
    ends = tuple((xml.get(f"{end}Element", ""), xml.get(f"{end}Connector", "")) for end in ("start", "end"))
    line, refused = read_transformation(xml)
    return Link((ends[0], ends[1]), line, xml.get("suppressUnitConversion") in ("true", "1"), refused)


def read_transformation(xml: Xml) -> tuple[Line, str]:
    """Linear transformation of a connection or of an entry of a mapping, and the name of another one."""
    if (found := next((child for child in xml if plain(child.tag).endswith("Transformation")), None)) is None:
        return Line(), ""
    if plain(found.tag) != "ssc:LinearTransformation":
        return Line(), plain(found.tag)
    return Line(float(found.get("factor", 1.0)), float(found.get("offset", 0.0))), ""
