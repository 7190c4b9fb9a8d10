"""Complete the model description that pythonfmu writes: units, ranges, dependencies, initial unknowns, identity."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gapsense.fmi.ports import Component, Port
from gapsense.problems import suggest
from gapsense.units import UNITS, base_exponents

TOOL = "Gapsense"  # by which our annotations are known
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
    _insert(root, "LogCategories", units(component))
    _insert(root, "ModelVariables", experiment(component))
    annotations = Element("VendorAnnotations")
    SubElement(annotations, "Tool", name=TOOL).append(rules(component))
    _insert(root, "ModelVariables", annotations)
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


def experiment(component: Component) -> Element:
    """A fitting experiment."""
    times = {"startTime": "0.0", "stopTime": repr(component.stop_time), "stepSize": repr(component.step_size)}
    return Element("DefaultExperiment", times)


def _insert(root: Element, tag: str, new: Element) -> None:
    """Put an element in front of the one called `tag`."""
    root.insert(list(root).index(_find(root, tag)), new)


def units(component: Component, more: Iterable[str] = ()) -> Element:
    """Definitions of the units of a component, and of more."""
    definitions, names = Element("UnitDefinitions"), {*(port.unit for port in component.ports), *more}
    if unknown := sorted(names - set(UNITS)):
        raise ValueError(f"{component.name}: unit {', '.join(unknown)} is not known. Add it to gapsense/units.py.")
    for name in sorted(names):
        unit = SubElement(definitions, "Unit", name=name)
        SubElement(unit, "BaseUnit", {k: str(v) for k, v in base_exponents(name).items()})
        if display := UNITS[name].display:
            SubElement(unit, "DisplayUnit", name=display.name, factor=repr(display.factor))
    return definitions


def rules(component: Component) -> Element:
    """What FMI has no words for: choices, columns of tables, parameters that belong together; see `cosim/fmu/rules`."""
    rules = Element("Rules")
    for port in component.of("parameter"):
        for tag, texts in (("Choices", port.choices), ("Table", port.columns)):
            parent = SubElement(rules, tag, variable=port.name) if texts else None
            for text in texts:
                SubElement(parent, "Item").text = text  # type: ignore[arg-type]  # there is one where there are texts
    for lower, upper in component.rising:
        SubElement(rules, "Rising", lower=lower, upper=upper)
    for limit in component.limits:
        element = SubElement(rules, "Limit", below=repr(float(limit.below)), reason=limit.reason)
        for name, power in limit.powers:
            SubElement(element, "Factor", variable=name, power=str(power))
    return rules


def _complete_variable(variable: Element, port: Port) -> None:
    value = variable[0]
    if port.kind == "Real":
        value.set("unit", port.unit)
        if display := UNITS[port.unit].display:
            value.set("displayUnit", display.name)
        value.set("nominal", repr(float(port.nominal)))
        if "start" in value.attrib:
            value.set("start", repr(float(port.start)))  # pythonfmu rounds to 16 digits
    if convert := {"Real": float, "Integer": int}.get(port.kind):
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
            needed = sorted((index[name] for name in (*port.feedthrough, *more)), key=int)
            SubElement(node, "Unknown", index=index[port.name], dependencies=" ".join(needed))


def _find(root: Element, tag: str) -> Element:
    found = root.find(tag)
    if found is None:
        raise ValueError(f"the model description has no <{tag}>.")
    return found
