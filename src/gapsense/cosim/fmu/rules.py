"""Rules for parameters that an FMU states in its annotations: choices, tables, parameters that belong together.

FMI has no words for them, so that otherwise only the run would tell. They are written by `fmi/describe.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from gapsense.cosim.fmu.archive import UnusableError
from gapsense.cosim.fmu.variables import Variable
from gapsense.fmi.ports import Component, Limit, Port
from gapsense.fmi.values import KINDS, ValuesError, fields
from gapsense.tables import Value

PLACES = (  # of FMI 2.0 and of FMI 3.0
    "VendorAnnotations/Tool[@name='Gapsense']/Rules",
    "Annotations/Annotation[@type='gapsense.rules']/Rules",
)
HIGHEST_POWER = 9


def read_rules(root: Element, variables: Mapping[str, Variable]) -> Component | None:
    """Rules of a model description, as a port table of the parameters that they can be applied to; None for none."""
    rules = next((found for place in PLACES if (found := root.find(place)) is not None), None)
    if rules is None:
        return None
    try:
        texts = {tag: {e.attrib["variable"]: items(e) for e in rules.findall(tag)} for tag in ("Choices", "Table")}
        ports = tuple(
            Port(
                name=v.name,
                causality="parameter",
                unit=v.unit or "1",
                description="",
                start=v.start,
                min=v.min,
                max=v.max,
                kind=v.type,
                choices=texts["Choices"].get(v.name, ()),
                columns=texts["Table"].get(v.name, ()),
            )
            for v in variables.values()
            if v.is_parameter and v.start is not None and v.type in KINDS
        )
        known = {port.name for port in ports if port.kind == "Real"}
        rising = tuple((e.attrib["lower"], e.attrib["upper"]) for e in rules.findall("Rising"))
        limits = tuple(limit(element) for element in rules.findall("Limit"))
        named = {*sum(rising, ()), *(name for own in limits for name, _ in own.powers)}
        if not named <= known:
            raise ValueError(f"no Real parameter `{min(named - known)}`")
    except (KeyError, ValueError) as error:
        raise UnusableError(f"its annotations for Gapsense are wrong: {error}. Build or export it again.") from error
    return Component("", "", "", ports, rising=rising, limits=limits)


def items(element: Element) -> tuple[str, ...]:
    """Texts of the items in an element."""
    return tuple(item.text or "" for item in element.findall("Item"))


def limit(element: Element) -> Limit:
    """Limit of a product."""
    powers = tuple((e.attrib["variable"], int(e.attrib["power"])) for e in element.findall("Factor"))
    if any(not 0 < abs(power) <= HIGHEST_POWER for _, power in powers):
        raise ValueError(f"powers from 1 to {HIGHEST_POWER} expected")
    return Limit(powers, float(element.attrib["below"]), element.attrib["reason"])


def broken_rules(rules: Component, values: Mapping[str, Value]) -> list[str]:
    """What is wrong with values of parameters that fit their types and ranges; tables within the FMU are not read."""
    ports = tuple(port for port in rules.ports if is_known(port, values))
    try:
        fields(rules._replace(ports=ports), {p.name: values[p.name] for p in ports if p.name in values}, Path())
    except ValuesError as error:
        return error.problems
    except ArithmeticError:  # a limit by a parameter that is 0
        return []
    return []


def is_known(port: Port, values: Mapping[str, Value]) -> bool:
    """True for a parameter that can be judged without the FMU: no free text, no table that it brings along or lacks."""
    if port.columns:
        file = Path(str(values.get(port.name, "")))
        return file.is_absolute() and file.is_file()
    return port.kind != "String" or bool(port.choices)
