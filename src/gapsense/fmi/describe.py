"""Complete the model description that pythonfmu writes: units, ranges, dependencies, initial unknowns, identity."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gapsense.fmi.ports import Component, Port
from gapsense.problems import suggest
from gapsense.units import UNITS, base_exponents

IDENTITY = {
    "generationTool": "Gapsense with pythonfmu",
    "variableNamingConvention": "flat",
    "author": "The Gapsense authors",
    "license": "MIT",
    "copyright": "Copyright (c) The Gapsense authors",
}


def complete(root: Element, component: Component, guid: str, version: str) -> Element:
    """Add to pythonfmu's `modelDescription.xml` what importers check; no build time: equal sources, equal bytes."""
    root.attrib.pop("generationDateAndTime", None)
    root.attrib.update(IDENTITY, guid=guid, version=version)
    _add_units(root, component)
    _set_experiment(root, component)
    for variable, port in zip(root.iterfind("ModelVariables/ScalarVariable"), component.ports):
        if variable.get("name") != port.name:
            raise ValueError(f"{component.name}: variable {variable.get('name')} where {port.name} was expected.")
        _complete_variable(variable, port)
    _set_structure(root, component)
    return root


def text(root: Element) -> bytes:
    """The XML file."""
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}\n'.encode()


def _add_units(root: Element, component: Component) -> None:
    definitions, names = Element("UnitDefinitions"), {port.unit for port in component.ports}
    if unknown := sorted(names - set(UNITS)):
        raise ValueError(f"{component.name}: unit {', '.join(unknown)} is not known. Add it to gapsense/units.py.")
    for name in sorted(names):
        unit = SubElement(definitions, "Unit", name=name)
        SubElement(unit, "BaseUnit", {k: str(v) for k, v in base_exponents(name).items()})
        display = UNITS[name].display
        if display:
            SubElement(unit, "DisplayUnit", name=display.name, factor=repr(display.factor))
    root.insert(list(root).index(_find(root, "LogCategories")), definitions)


def _set_experiment(root: Element, component: Component) -> None:
    attributes = {"startTime": "0.0", "stopTime": repr(component.stop_time), "stepSize": repr(component.step_size)}
    root.insert(list(root).index(_find(root, "ModelVariables")), Element("DefaultExperiment", attributes))


def _complete_variable(variable: Element, port: Port) -> None:
    value = variable[0]
    if port.kind == "Real":
        value.set("unit", port.unit)
        display = UNITS[port.unit].display
        if display:
            value.set("displayUnit", display.name)
        value.set("nominal", repr(float(port.nominal)))
        if "start" in value.attrib:
            value.set("start", repr(float(port.start)))  # pythonfmu rounds to 16 digits
    if port.kind in ("Real", "Integer"):
        convert = float if port.kind == "Real" else int
        value.attrib.update({k: repr(convert(v)) for k, v in (("min", port.min), ("max", port.max)) if v is not None})


def _set_structure(root: Element, component: Component) -> None:
    """Outputs with their feedthrough; at the start they depend on the parameters too."""
    index = {port.name: str(k) for k, port in enumerate(component.ports, 1)}
    parameters = [port.name for port in component.of("parameter")]
    inputs = [port.name for port in component.of("input")]
    for port in component.of("output"):
        for name in {*port.feedthrough} - {*inputs}:
            raise ValueError(f"{component.name}: `{port.name}` follows `{name}`, no input. {suggest(name, inputs)}")
    structure = _find(root, "ModelStructure")
    structure.clear()
    for tag, more in (("Outputs", []), ("InitialUnknowns", parameters)):
        node = SubElement(structure, tag)
        for port in component.of("output"):
            SubElement(
                node, "Unknown", index=index[port.name], dependencies=_indices(index, (*port.feedthrough, *more))
            )


def _indices(index: dict[str, str], names: Iterable[str]) -> str:
    return " ".join(sorted((index[n] for n in names), key=int))


def _find(root: Element, tag: str) -> Element:
    found = root.find(tag)
    if found is None:
        raise ValueError(f"the model description has no <{tag}>.")
    return found
