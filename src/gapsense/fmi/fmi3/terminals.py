"""terminalsAndIcons.xml of FMI 3.0: signals that are wired together, and the picture.

A terminal for inputs has the name and the members of what drives them as a rule (`wiring.py`), one for outputs is named
after what the component is. Where the names of members are equal, a tool may connect two terminals as a bundle.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from gapsense.fmi.describe import text
from gapsense.fmi.ports import Component

NAME, ICON = "terminalsAndIcons/terminalsAndIcons.xml", "terminalsAndIcons/icon.png"
ROLES = {"actuators": "plant", "drive": "drive", "sensor": "sensor", "estimators": "estimate"}  # by part of the package
CORNERS = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}


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
