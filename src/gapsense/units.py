"""The units of the project: SI, written as Modelica tools do, with base-unit exponents and units for display."""

from __future__ import annotations

from typing import NamedTuple


class DisplayUnit(NamedTuple):
    """A unit for display."""

    name: str
    factor: float  # value in it = factor * SI value


class Unit(NamedTuple):
    """Exponents of kg, m, s, A, the display unit, if any, and the quantity that is usually meant by it."""

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    display: DisplayUnit | None = None
    quantity: str = ""


UNITS = {
    "1": Unit(),
    "s": Unit(s=1, display=DisplayUnit("ms", 1e3), quantity="time"),
    "Hz": Unit(s=-1, quantity="frequency"),
    "m": Unit(m=1, display=DisplayUnit("mm", 1e3), quantity="length"),
    "1/m": Unit(m=-1),
    "m2": Unit(m=2, display=DisplayUnit("mm2", 1e6), quantity="area"),
    "m/s": Unit(m=1, s=-1, quantity="velocity"),
    "m/s2": Unit(m=1, s=-2, quantity="acceleration"),
    "s/m": Unit(m=-1, s=1),
    "kg": Unit(kg=1, display=DisplayUnit("g", 1e3), quantity="mass"),
    "N": Unit(kg=1, m=1, s=-2, quantity="force"),
    "N/m": Unit(kg=1, s=-2, quantity="stiffness"),
    "N.s/m": Unit(kg=1, s=-1, quantity="damping"),
    "J": Unit(kg=1, m=2, s=-2, display=DisplayUnit("mJ", 1e3), quantity="energy"),
    "V": Unit(kg=1, m=2, s=-3, A=-1, quantity="voltage"),
    "A": Unit(A=1, display=DisplayUnit("mA", 1e3), quantity="current"),
    "A/m": Unit(m=-1, A=1, quantity="field"),
    "Ohm": Unit(kg=1, m=2, s=-3, A=-2, quantity="resistance"),
    "Ohm/s": Unit(kg=1, m=2, s=-4, A=-2),
    "S": Unit(kg=-1, m=-2, s=3, A=2, quantity="conductance"),
    "Wb": Unit(kg=1, m=2, s=-2, A=-1, display=DisplayUnit("mWb", 1e3), quantity="flux linkage"),
    "T": Unit(kg=1, s=-2, A=-1, quantity="flux density"),
    "F": Unit(kg=-1, m=-2, s=4, A=2, display=DisplayUnit("uF", 1e6)),
    "H": Unit(kg=1, m=2, s=-2, A=-2, display=DisplayUnit("mH", 1e3), quantity="inductance"),
    "H/s2": Unit(kg=1, m=2, s=-4, A=-2),
    "1/H": Unit(kg=-1, m=-2, s=2, A=2, quantity="reluctance"),
    "1/(H.m)": Unit(kg=-1, m=-3, s=2, A=2),
}

QUANTITIES = {name: unit.quantity for name, unit in UNITS.items() if unit.quantity}
PREFIXES = {"": 1.0, "k": 1e3, "m": 1e-3, "u": 1e-6, "\u00b5": 1e-6, "\u03bc": 1e-6, "n": 1e-9}


def factor(written: str, unit: str) -> float | None:
    """SI value of one `written`, a unit with or without a prefix (`ms`, `mA`), if it is a multiple of `unit`."""
    if unit == "1":
        return 1.0 if written in ("1", "-", "") else None
    return PREFIXES.get(written.removesuffix(unit)) if written.endswith(unit) else None


def base_exponents(unit: str) -> dict[str, int]:
    """Non-zero exponents of the SI base units in `unit`."""
    return {name: power for name in ("kg", "m", "s", "A") if (power := getattr(UNITS[unit], name))}
