"""Model descriptions as XML: small mistakes of exporters are mended, references to nothing are refused."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element, fromstring, tostring

from gapsense.cosim.fmu.archive import UnusableError, shown

PARAMETERS = ("parameter", "calculatedParameter")
NOT_REAL = ("Integer", "Boolean", "String", "Enumeration")


def mended(data: bytes) -> tuple[Element, bytes]:
    """A model description, and its text with the variability that some exporters leave out where FMI asks for it.

    Without one a variable of FMI 2.0 is continuous, which a parameter and a variable that is not Real cannot be.
    """
    root = fromstring(data)
    refuse_version(root.get("fmiVersion", "without a version"))
    found = [variable for variable in root.iterfind("ModelVariables/ScalarVariable") if lacks_variability(variable)]
    for variable in found:
        variable.set("variability", "fixed" if variable.get("causality") in PARAMETERS else "discrete")
    refuse_dangling(root)
    return root, tostring(root, "utf-8", xml_declaration=True) if found else data


def refuse_version(version: str) -> None:
    """Raise unless an FMU is of FMI 2.0 or 3.0."""
    if version != "2.0" and not version.startswith("3.0"):
        raise UnusableError(f"FMI {shown(version)} found, FMI 2.0 or 3.0 co-simulation expected. Export it as that.")


def lacks_variability(variable: Element) -> bool:
    """True for a variable of FMI 2.0 whose default variability its causality or its type rules out."""
    is_other = any(child.tag in NOT_REAL for child in variable)
    return "variability" not in variable.attrib and (is_other or variable.get("causality") in PARAMETERS)


def refuse_dangling(root: Element) -> None:
    """Raise if the model structure refers to variables that there are not."""
    is_old = root.get("fmiVersion") == "2.0"
    variables = root.find("ModelVariables")
    elements = list(variables) if variables is not None else []
    known = {str(k) for k in range(1, len(elements) + 1)} if is_old else {v.get("valueReference") for v in elements}
    for place, reference in references(root, "index" if is_old else "valueReference"):
        if (reference.lstrip("0") or "0") not in known:
            found = f"its model structure refers to variable {shown(reference)} in `{place}`, which it does not have"
            raise UnusableError(f"{found}. Export it again.")


def references(root: Element, key: str) -> Iterator[tuple[str, str]]:
    """Every reference of the model structure with the element that it stands in."""
    for element in root.iterfind("ModelStructure//*"):
        for attribute in (key, "dependencies"):
            for reference in element.get(attribute, "").split():
                yield element.tag, reference
