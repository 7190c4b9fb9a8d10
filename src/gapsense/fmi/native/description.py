"""The model description of a native FMU of FMI 2.0: that of the Python FMU but for what is said of the FMU itself."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from gapsense.fmi import describe
from gapsense.fmi.ports import Component, Port

FLAGS = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
CATEGORIES = ("Warning", "Discard", "Error", "Fatal")


def description(component: Component, guid: str, version: str, sources: Iterable[str]) -> bytes:
    """`modelDescription.xml`."""
    about = {"fmiVersion": "2.0", "modelName": component.name, "description": component.description}
    root = Element("fmiModelDescription", about)
    kind = SubElement(root, "CoSimulation", {"modelIdentifier": component.name, **FLAGS})
    files = SubElement(kind, "SourceFiles")
    for name in sources:
        SubElement(files, "File", name=name)
    log = SubElement(root, "LogCategories")
    for name in CATEGORIES:
        SubElement(log, "Category", name=f"logStatus{name}", description=f"Log messages with fmi2{name} status.")
    SubElement(log, "Category", name="logAll", description="Log all messages.")
    variables = SubElement(root, "ModelVariables")
    for reference, port in enumerate(component.ports):
        _add_variable(variables, reference, port)
    SubElement(root, "ModelStructure")
    describe.complete(root, component, guid, version)
    root.set("generationTool", describe.TOOL)
    return describe.text(root)


def _add_variable(variables: Element, reference: int, port: Port) -> None:
    is_output = port.causality == "output"
    about = {"name": port.name, "valueReference": str(reference), "description": port.description}
    kinds = {"causality": port.causality, "variability": port.variability}
    more = {"initial": "calculated"} if is_output else {}
    variable = SubElement(variables, "ScalarVariable", {**about, **kinds, **more})
    start = str(port.start).lower() if port.kind == "Boolean" else str(port.start)
    SubElement(variable, port.kind, {} if is_output else {"start": start})
