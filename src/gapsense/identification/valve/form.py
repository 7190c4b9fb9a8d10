"""What is sought of a valve, and what is held: the form of the model that is fitted."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from gapsense.identification.gap_law.laws import Law, rows
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.device import Device, changed, value

FITTED = ("coil_turns", "core_reluctance", "core_saturation", "spring_stiffness", "damping", "mover_mass")
BOUND = 5.0  # the result lies within this factor of the first guess
WIDE = 300.0  # or within this one, if hardly anything is known of it
SHAPE = "gap_shape_"  # and a number, of the gap law
TABLE = ("gap_file_reluctance", "gap_file_slope")
LOST = 1.0  # relative standard error
FACTOR = "coil_factor"  # no parameter of the device, but one on the resistances of (23)
GUESSED = ("core_eddy", "core_hysteresis", "core_turnover", "gap_window", "gap_area")
LIMITS = {**dict.fromkeys(GUESSED, WIDE), "core_turnover": 10.0}  # below, hysteresis is friction; beyond, a reluctance


class Form(NamedTuple):
    """The names that are fitted, from their values in `known` on; all else is held at its value there."""

    known: Device
    fitted: tuple[str, ...] = FITTED
    added: tuple[str, ...] = ()  # to the plain form, see `forms`
    law: Law | None = None  # of the gap, where its shape is fitted or the core leaves it its offset
    total: float | None = None  # reluctance of core and gap when it is closed, where that is known [1/H]

    def at(self, ratios: Vector) -> Device:
        """The fitted parameters multiplied by e^ratio, so that they stay positive; the others as they are known."""
        factors = zip(self.fitted, np.exp(ratios).tolist())
        made = changed(self.known, **{n: x for name, f in factors for n, x in multiplied(self.known, name, f)})
        return made if self.law is None else changed(made, **_table(self.law_at(ratios), made))

    def law_at(self, ratios: Vector) -> Law:
        """The gap law with its fitted numbers; what is known without a gap is that of core and gap together."""
        law = self.law or Law("none", 0.0, ())
        at = dict(zip(self.fitted, np.exp(ratios).tolist()))
        offset, *numbers = (at.get(name, 1.0) * x for name, x in zip(shape(law), (law.offset, *law.numbers)))
        if self.total is not None:
            offset = self.total - value(self.known, "core_reluctance") * at.get("core_reluctance", 1.0)
        return law._replace(offset=offset, numbers=tuple(numbers))

    @property
    def bounds(self) -> Vector:
        """Largest ratios."""
        return np.log([self.limit(name) for name in self.fitted])

    def limit(self, name: str) -> float:
        """Largest factor on a first guess."""
        return LIMITS.get(name, BOUND)

    def factor(self, ratios: Vector) -> float:
        """On the resistances."""
        return float(np.exp(ratios[self.fitted.index(FACTOR)])) if FACTOR in self.fitted else 1.0

    def settled(self, ratios: Vector) -> Vector:
        """The ratios once the resistances have taken their factor."""
        return np.where([name == FACTOR for name in self.fitted], 0.0, ratios)

    def restarted(self, ratios: Vector) -> Vector:
        """The ratios with the first guess of the turnover, whose minimum may be a false one."""
        return np.where([name == "core_turnover" for name in self.fitted], 0.0, ratios)

    @property
    def start(self) -> Vector:
        """Ratios of the first guess."""
        return np.zeros(len(self.fitted))

    def without_lost(self, ratios: Vector, errors: Vector) -> tuple[Form, Vector]:
        """The form that holds what was not identified, and its ratios: at the first guess what has no effect at all.

        `errors` are the relative standard errors of the fitted parameters.  What was added to the plain form is lost if
        they are larger than the value; the parameters of the plain form are kept, and called poor.
        """
        names = [name for name in self.fitted if name != FACTOR]
        none = {name for name, error in zip(names, errors) if np.isinf(error)}
        lost = none | {name for name, error in zip(names, errors) if name in GUESSED and not error < LOST}
        free = [name not in lost for name in self.fitted]
        now = self.at(np.where([name in none for name in self.fitted], 0.0, ratios))
        known = changed(self.known, **{name: value(now, name) for name in lost})
        fitted = tuple(name for name in self.fitted if name not in lost)
        return self._replace(known=known, fitted=fitted), ratios[free]


def shape(law: Law) -> tuple[str, ...]:
    """Names of the numbers of a gap law, its offset first, which are no parameters of the device."""
    return tuple(f"{SHAPE}{k}" for k in range(len(law.numbers) + 1))


def _table(law: Law, par: Device) -> dict[str, Any]:
    """The gap law as a table of the device."""
    made = rows(law, float(value(par, "stop_upper")))
    return {f"gap_file_{name}": column.tolist() for name, column in made.items()}


def multiplied(par: Device, name: str, factor: float) -> list[tuple[str, Any]]:
    """A parameter times a factor; of the table of a gap law, both columns."""
    if name.startswith(SHAPE):
        return []
    if name != TABLE[0]:
        return [(name, value(par, name) * factor)]
    return [(column, [factor * x for x in value(par, column)]) for column in TABLE]
