"""Units of SSP and of FMUs by their base units, and numbers from one unit to another."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, fromstring

from gapsense._os.files import remember
from gapsense.cosim.fmu.archive import DESCRIPTION
from gapsense.ssp.words import tag
from gapsense.units import UNITS, base_exponents

EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


class BaseUnit(NamedTuple):
    """A unit: `SI value = factor * value + offset`, and its exponents."""

    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0


Units = Mapping[str, BaseUnit]


class Line(NamedTuple):
    """`factor * x + offset`."""

    factor: float = 1.0
    offset: float = 0.0

    def then(self, other: Line) -> Line:
        """Another line after this one; if one of them changes nothing, the other is returned as it is."""
        if other == Line():
            return self
        return other if self == Line() else Line(other.factor * self.factor, other.factor * self.offset + other.offset)

    def of(self, value: float) -> float:
        """A number after the conversion; one that is not converted keeps its bits."""
        return value if self == Line() else self.factor * value + self.offset


def conversion(source: str, target: str, units: Units) -> Line | None:
    """Line from a number in one unit to that in another, or None if there is none."""
    if source == target:
        return Line()
    ends = units.get(source), units.get(target)
    if ends[0] is None or ends[1] is None or ends[0].exponents != ends[1].exponents:
        return None
    one, other = ends[0], ends[1]
    if (one.factor, one.offset) == (other.factor, other.offset):
        return Line()
    return Line(one.factor / other.factor, (one.offset - other.offset) / other.factor)


def read_base(element: Element) -> BaseUnit:
    """Base unit as SSP and FMI 2.0 write it."""
    exponents = tuple(int(element.get(name, 0)) for name in EXPONENTS)
    return BaseUnit(exponents, float(element.get("factor", 1.0)), float(element.get("offset", 0.0)))


def read_units(root: Element, path: str) -> dict[str, BaseUnit]:
    """Units that a document of SSP defines below `path`."""
    bases = {unit.get("name", ""): unit.find(tag("ssc:BaseUnit")) for unit in root.iterfind(path)}
    return {name: read_base(base) for name, base in bases.items() if base is not None}


@remember
def units_of(fmu: Path) -> Units:
    """Units that an FMU defines, and ours for names that it leaves undefined; its description was read before."""
    with zipfile.ZipFile(fmu) as archive:
        root = fromstring(archive.read(DESCRIPTION))
    bases = {unit.get("name", ""): unit.find("BaseUnit") for unit in root.iterfind("UnitDefinitions/Unit")}
    powers = {name: base_exponents(name) for name in UNITS}
    ours = {name: BaseUnit(tuple(own.get(base, 0) for base in EXPONENTS)) for name, own in powers.items()}
    return {**ours, **{name: read_base(base) for name, base in bases.items() if base is not None}}


def together(found: Iterable[Units]) -> tuple[dict[str, BaseUnit], list[str]]:
    """All units, and the names that mean different things in two of them."""
    known: dict[str, BaseUnit] = {}
    other: dict[str, None] = {}
    for units in found:
        for name, base in units.items():
            if known.setdefault(name, base) != base:
                other[name] = None
    return known, list(other)
