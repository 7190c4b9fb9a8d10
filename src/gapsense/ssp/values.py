"""Values of parameters: sets of SSV, mappings of SSM, inline or in files, and what they mean for each variable."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element as Xml

from gapsense.cosim.fmu.archive import UnusableError, sanitise
from gapsense.problems import suggest
from gapsense.ssp.package import Package
from gapsense.ssp.structure import Element, Place, read_transformation
from gapsense.ssp.units import Line, Units, read_units
from gapsense.ssp.words import MAPPING_TYPE, VALUES_TYPE, plain, tag
from gapsense.tables import Value

Node = tuple[Place, str]  # an element and a name in it: a variable, or a connector of a system


class Given(NamedTuple):
    """A value with its unit, what the unit means in its document, and the place it comes from."""

    value: Value
    unit: str
    units: Units
    place: str
    line: Line = Line()  # after the conversion of the unit
    suppress: bool = False  # no conversion of units


class BindingReader:
    """Reads the parameter bindings of all elements; `problems` and `notes` take what is wrong, and what is left out."""

    def __init__(
        self,
        package: Package,
        units: Units,
        known: Mapping[Place, Collection[str]],
        problems: list[str],
        notes: list[str],
    ) -> None:
        self.package, self.units, self.known = package, units, known  # variables of each component whose FMU is read
        self.problems, self.notes = problems, notes
        self.given: dict[Node, Given] = {}
        self.used: set[tuple[str, str]] = set()  # source and name of values that some element has
        self.unused: dict[tuple[str, str], str] = {}

    def read(self, element: Element) -> None:
        """Values of an element and everything below it. Outer ones are read later, and so win."""
        for inner in element.elements.values():
            self.read(inner)
        for xml in element.xml.iterfind(f"{tag('ssd:ParameterBindings')}/{tag('ssd:ParameterBinding')}"):
            try:
                self.bind(element, xml)
            except (UnusableError, ValueError) as error:
                self.problems.append(f"{element.name}, parameter binding: {error}")

    def finish(self) -> None:
        """Note what no element has; of a file that several elements share, each takes its own."""
        self.problems += [place for key, place in self.unused.items() if key not in self.used]

    def bind(self, element: Element, xml: Xml) -> None:
        """Values of one binding."""
        source = xml.get("source", "")
        root = self.part(xml, "ssd:ParameterValues", "ssv:ParameterSet", (VALUES_TYPE, "ssv"))
        mapping = xml.find(tag("ssd:ParameterMapping"))
        values = {name: given for name, given in self.values(root, source or element.name)}
        if mapping is not None:
            values = self.apply_mapping(values, self.part(mapping, "", "ssm:ParameterMapping", (MAPPING_TYPE, "ssm")))
        for name, given in values.items():
            self.give(element, xml.get("prefix", "") + name, given, source or str(id(xml)))

    def part(self, xml: Xml, around: str, name: str, kind: tuple[str, str]) -> Xml:
        """Content of a binding or of its mapping: from its file, or inline."""
        source, own = xml.get("source", ""), xml.get("type", kind[0]) or kind[0]
        if own != kind[0]:
            raise UnusableError(f"it is of type `{sanitise(own)}`, `{kind[0]}` expected. Export it as that.")
        if source and xml.get("sourceBase", "SSD") != "SSD":
            raise UnusableError(
                f"its source `{sanitise(source)}` is in the component. Put it beside the system structure."
            )
        if source:
            root, violations = self.package.document(self.package.member(source), kind[1])
            self.notes += [f"{sanitise(source)} is not as the schema says: {text}" for text in violations]
            return root
        holder = xml.find(tag(around)) if around else xml
        found = None if holder is None else holder.find(tag(name))
        if found is None:
            raise UnusableError(f"it has neither a source nor `{name}`. Give one of them.")
        return found

    def values(self, root: Xml, place: str) -> Iterator[tuple[str, Given]]:
        """Values of a set by name."""
        units = {**self.units, **read_units(root, f"{tag('ssv:Units')}/{tag('ssc:Unit')}")}
        for xml in root.iterfind(f"{tag('ssv:Parameters')}/{tag('ssv:Parameter')}"):
            name, where = (xml.get("name", ""), f"{sanitise(place)}, parameter `{sanitise(xml.get('name', ''))}`")
            typed = next((child for child in xml if plain(child.tag).startswith("ssv:")), None)
            value = (
                None if typed is None else parse_value(plain(typed.tag).removeprefix("ssv:"), typed.get("value", ""))
            )
            if typed is None or value is None:
                kind = "nothing" if typed is None else sanitise(f"{plain(typed.tag)} `{typed.get('value', '')}`")
                self.problems.append(f"{where}: {kind} found, a number, a truth value or a text expected. Correct it.")
            else:
                yield name, Given(value, typed.get("unit", ""), units, where)

    def apply_mapping(self, values: Mapping[str, Given], root: Xml) -> dict[str, Given]:
        """Rename values as a mapping says; what it does not name is left out."""
        out: dict[str, Given] = {}
        entries = [*root.iterfind(tag("ssm:MappingEntry"))]
        for xml in entries:
            source, target = xml.get("source", ""), xml.get("target", "")
            line, refused = read_transformation(xml)
            if refused:
                self.problems.append(f"mapping of `{sanitise(source)}`: `{refused}` is not supported. Map its result.")
            elif source not in values:
                self.problems.append(f"mapping: there is no value `{sanitise(source)}`. Correct its source.")
            else:
                suppress = xml.get("suppressUnitConversion") in ("true", "1")
                out[target] = values[source]._replace(line=line, suppress=suppress)
        left = sorted(set(values) - {xml.get("source", "") for xml in entries})
        self.notes += [f"{values[name].place} is in no entry of its mapping, and is left out." for name in left]
        return out

    def give(self, element: Element, name: str, given: Given, source: str) -> None:
        """Keep a value for the element that a hierarchical name means."""
        node = target(element, name)
        known = () if node is None else self.known.get(node[0])
        if node is None or (known is not None and node[1] not in known):
            hint = suggest(name, known or ())
            self.unused[source, name] = f"{given.place}: there is no `{sanitise(name)}` in {element.name}. {hint}"
        else:
            self.used.add((source, name))
            self.given[node] = given


def target(element: Element, name: str) -> Node | None:
    """What a name means in an element: a variable of a component, or a connector of a system."""
    if element.is_component or name in element.connectors:
        return element.path, name
    for inner in sorted(element.elements, key=len, reverse=True):
        if name.startswith(f"{inner}."):
            return target(element.elements[inner], name[len(inner) + 1 :])
    return None


def parse_value(kind: str, text: str) -> Value | None:
    """Read a value of SSP as TOML writes it, or None if TOML cannot."""
    if kind in ("String", "Enumeration"):
        return text
    if kind == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}.get(text.strip())
    try:
        number = float(text) if kind == "Real" else int(text) if kind == "Integer" else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None
