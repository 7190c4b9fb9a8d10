"""Names of SSP 1.0: namespaces, kinds, media types, files."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

PREFIXES = {  # tools that do not read namespaces want just these
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "gapsense": "urn:gapsense:ssp:1",
}
VERSION = "1.0"
DESCRIPTION = "SystemStructure.ssd"
VALUES = "resources/parameters.ssv"  # all values by `component.variable`; no binding names it
FMU_TYPE, VALUES_TYPE = "application/x-fmu-sharedlibrary", "application/x-ssp-parameter-set"
MAPPING_TYPE = "application/x-ssp-parameter-mapping"
OWN, OSP = "gapsense", "com.opensimulationplatform"  # types of annotations
TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration", "Binary")
SCHEMAS = {
    "ssd": "SystemStructureDescription.xsd",
    "ssv": "SystemStructureParameterValues.xsd",
    "ssm": "SystemStructureParameterMapping.xsd",
}


def number_names(stem: str, ending: str = "") -> Iterator[str]:
    """Number names, `stem`, `stem_1` and so on, with an ending; the caller takes the first that is free."""
    return (f"{stem}{f'_{k}' if k else ''}{ending}" for k in count())


def tag(name: str) -> str:
    """`ssd:System` as ElementTree writes it."""
    prefix, _, local = name.partition(":")
    return f"{{{PREFIXES[prefix]}}}{local}"


def plain(name: str) -> str:
    """Name of an element as ElementTree has it, with the usual prefix of its namespace if that is known."""
    space, _, local = name.removeprefix("{").rpartition("}")
    prefix = next((prefix for prefix, uri in PREFIXES.items() if uri == space), space)
    return f"{prefix}:{local}" if prefix else local
