"""The units of the project: SI, written as Modelica tools do, with base-unit exponents and units for display."""

from __future__ import annotations

from typing import NamedTuple


class DisplayUnit(NamedTuple):
    """A unit for display."""

    name: str
    factor: float  # value in it = factor * SI value


class Unit(NamedTuple):
    """Exponents of kg, m, s, A and the display unit, if any."""

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    display: DisplayUnit | None = None


UNITS = {
    "1": Unit(),
    "s": Unit(s=1, display=DisplayUnit("ms", 1e3)),
    "Hz": Unit(s=-1),
    "m": Unit(m=1, display=DisplayUnit("mm", 1e3)),
    "1/m": Unit(m=-1),
    "m2": Unit(m=2, display=DisplayUnit("mm2", 1e6)),
    "m/s": Unit(m=1, s=-1),
    "m/s2": Unit(m=1, s=-2),
    "s/m": Unit(m=-1, s=1),
    "kg": Unit(kg=1, display=DisplayUnit("g", 1e3)),
    "N": Unit(kg=1, m=1, s=-2),
    "N/m": Unit(kg=1, s=-2),
    "N.s/m": Unit(kg=1, s=-1),
    "J": Unit(kg=1, m=2, s=-2, display=DisplayUnit("mJ", 1e3)),
    "V": Unit(kg=1, m=2, s=-3, A=-1),
    "A": Unit(A=1, display=DisplayUnit("mA", 1e3)),
    "A/m": Unit(m=-1, A=1),
    "Ohm": Unit(kg=1, m=2, s=-3, A=-2),
    "Ohm/s": Unit(kg=1, m=2, s=-4, A=-2),
    "S": Unit(kg=-1, m=-2, s=3, A=2),
    "Wb": Unit(kg=1, m=2, s=-2, A=-1, display=DisplayUnit("mWb", 1e3)),
    "T": Unit(kg=1, s=-2, A=-1),
    "F": Unit(kg=-1, m=-2, s=4, A=2, display=DisplayUnit("uF", 1e6)),
    "H": Unit(kg=1, m=2, s=-2, A=-2, display=DisplayUnit("mH", 1e3)),
    "H/s2": Unit(kg=1, m=2, s=-4, A=-2),
    "1/H": Unit(kg=-1, m=-2, s=2, A=2),
    "1/(H.m)": Unit(kg=-1, m=-3, s=2, A=2),
}

QUANTITIES = {  # that are usually meant by a unit
    "s": "time",
    "Hz": "frequency",
    "m": "length",
    "m2": "area",
    "m/s": "velocity",
    "m/s2": "acceleration",
    "kg": "mass",
    "N": "force",
    "N/m": "stiffness",
    "N.s/m": "damping",
    "J": "energy",
    "V": "voltage",
    "A": "current",
    "A/m": "field",
    "Ohm": "resistance",
    "S": "conductance",
    "Wb": "flux linkage",
    "T": "flux density",
    "H": "inductance",
    "1/H": "reluctance",
}

PREFIXES = {"": 1.0, "k": 1e3, "m": 1e-3, "u": 1e-6, "\u00b5": 1e-6, "\u03bc": 1e-6, "n": 1e-9}


def factor(written: str, unit: str) -> float | None:
    """SI value of one `written`, a unit with or without a prefix (`ms`, `mA`), if it is a multiple of `unit`."""
    if unit == "1":
        return 1.0 if written in ("1", "-", "") else None
    return PREFIXES.get(written.removesuffix(unit)) if written.endswith(unit) else None


def base_exponents(unit: str) -> dict[str, int]:
    """Non-zero exponents of the SI base units in `unit`."""
    return {name: power for name, power in UNITS[unit]._asdict().items() if name != "display" and power}
