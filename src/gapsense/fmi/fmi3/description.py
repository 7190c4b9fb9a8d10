"""modelDescription.xml of FMI 3.0, and buildDescription.xml."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from gapsense.fmi import describe
from gapsense.fmi.describe import text
from gapsense.fmi.fmi3.variables import Variable
from gapsense.fmi.ports import Component
from gapsense.units import UNITS

TERMINALS, TERMINALS_ICON = "terminalsAndIcons/terminalsAndIcons.xml", "terminalsAndIcons/icon.png"
ROLES = {"actuators": "plant", "drive": "drive", "sensor": "sensor", "estimators": "estimate"}  # by part of the package
CORNERS = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
RULES = "gapsense.rules"  # type of our annotation
ABILITIES = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUState", "canSerializeFMUState")
LANGUAGE = "C99"
OPTIONS = "-ffp-contract=off"


def model_description(component: Component, variables: Sequence[Variable], token: str, version: str) -> bytes:
    """The XML file; equal arguments give equal bytes."""
    about = {**describe.IDENTITY, "generationTool": "Gapsense", "version": version}
    own = {"fmiVersion": "3.0", "modelName": component.name, "instantiationToken": token}
    root = Element("fmiModelDescription", {**own, "description": component.description, **about})
    SubElement(root, "CoSimulation", {"modelIdentifier": component.name, **dict.fromkeys(ABILITIES, "true")})
    root.append(describe.units(component, {variable.unit for variable in variables} - {""}))
    types = [variable for variable in variables if variable.choices]
    definitions = SubElement(root, "TypeDefinitions") if types else root
    for variable in types:
        node = SubElement(definitions, "EnumerationType", name=f"Choices of {variable.name}")
        for number, choice in enumerate(variable.choices, 1):
            SubElement(node, "Item", name=choice, value=str(number))
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="Refusals and errors")
    root.append(describe.experiment(component))
    known = SubElement(root, "ModelVariables")
    for variable in variables:
        _add_variable(known, variable)
    _add_structure(SubElement(root, "ModelStructure"), variables)
    SubElement(SubElement(root, "Annotations"), "Annotation", type=RULES).append(describe.rules(component))
    return describe.text(root)


def build_description(name: str, sources: Sequence[str]) -> bytes:
    """How to compile the sources, for whoever has no binary for his machine."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = SubElement(configuration, "SourceFileSet")
    files.attrib.update(language=LANGUAGE, compilerOptions=OPTIONS)
    for source in sources:
        SubElement(files, "SourceFile", name=source)
    SubElement(configuration, "Library", name="m", description="Mathematics of the C library", external="true")
    return describe.text(root)


def _add_variable(parent: Element, variable: Variable) -> None:
    node = SubElement(parent, variable.type, name=variable.name, valueReference=str(variable.reference))
    node.attrib.update(causality=variable.causality, variability=variable.variability)
    node.set("description", variable.description)
    if variable.choices:
        node.set("declaredType", f"Choices of {variable.name}")
    if variable.unit:
        node.set("unit", variable.unit)
        if display := UNITS[variable.unit].display:
            node.set("displayUnit", display.name)
    limits = (("nominal", variable.nominal), ("min", variable.min), ("max", variable.max))
    node.attrib.update({key: _text(variable, value) for key, value in limits if value is not None})
    if variable.type == "String":
        SubElement(node, "Start", value=variable.start[0])
    elif variable.start:
        node.set("start", " ".join(_text(variable, value) for value in variable.start))
    for size in variable.shape:
        SubElement(node, "Dimension", start=str(size))
    if variable.rows is not None:
        SubElement(node, "Dimension", valueReference=str(variable.rows))


def _text(variable: Variable, value: Any) -> str:
    """A value as XML has it."""
    if variable.type == "Boolean":
        return str(value).lower()
    return repr(float(value)) if variable.type == "Float64" else str(int(value))


def _add_structure(structure: Element, variables: Sequence[Variable]) -> None:
    """Outputs with their feedthrough; at the start they depend on the parameters too."""
    references = {variable.name: variable.reference for variable in variables}
    fixed = [variable.reference for variable in variables if "arameter" in variable.causality]
    outputs = [variable for variable in variables if variable.causality == "output"]
    for tag, more in (("Output", []), ("InitialUnknown", fixed)):
        for variable in outputs:
            needed = sorted([*(references[name] for name in variable.feedthrough), *more])
            known = {"valueReference": str(variable.reference), "dependencies": " ".join(map(str, needed))}
            SubElement(structure, tag, known)


# terminalsAndIcons.xml of FMI 3.0: signals that are wired together, and the picture.
#
# A terminal for inputs has the name and the members of what drives them as a rule, `source` of a port; one for outputs
# is named after what the component is. Where the names of members are equal, a tool may connect two terminals as a
# bundle.


def terminals(component: Component) -> dict[str, dict[str, str]]:
    """Of every terminal the variables, by the names of its members."""
    found: dict[str, dict[str, str]] = {}
    for port in component.of("input"):
        owner, _, member = port.source.partition(".")
        if member:
            found.setdefault(owner, {})[member] = port.name
    own = next((ROLES[part] for part in component.kernel.split(".")[:-1] if part in ROLES), "outputs")
    for port in component.of("output"):
        first = port.name.partition("_")[0]
        found.setdefault(first if first in ("health", "smoothed") else own, {})[port.name] = port.name
    return found


def terminals_and_icons(component: Component) -> bytes:
    """The XML file."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = SubElement(root, "GraphicalRepresentation")
    SubElement(picture, "CoordinateSystem", CORNERS, suggestedScalingFactorTo_mm="0.1")
    SubElement(picture, "Icon", CORNERS)
    parent = SubElement(root, "Terminals")
    for name, members in terminals(component).items():
        node = SubElement(parent, "Terminal", name=name, matchingRule="bus")
        for member, variable in members.items():
            SubElement(node, "TerminalMemberVariable", variableName=variable, memberName=member, variableKind="signal")
    return text(root)
