"""Documents of SSP as XML: components, connectors, connections, values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from gapsense.cosim.fmu.variables import Variable
from gapsense.cosim.scenario.elements import Connection
from gapsense.ssp.units import EXPONENTS, Units
from gapsense.ssp.words import PREFIXES, VERSION, tag
from gapsense.tables import Value


def add(parent: Element, name: str, attributes: Mapping[str, Any] | None = None) -> Element:
    """A new element below another; attributes that are None are left out."""
    given = {key: str(value) for key, value in (attributes or {}).items() if value is not None}
    return SubElement(parent, tag(name), given)


def written(root: Element) -> bytes:
    """A document as text, with the usual prefixes: some tools know nothing but these."""
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
    """A connection; one that converts the unit by its factor must not have it converted once more."""
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
    used = sorted({name for name in names if name in units})
    if used:
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
