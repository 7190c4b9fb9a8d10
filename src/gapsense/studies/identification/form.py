"""What is sought of a valve, and what is held: the form of the model that is fitted."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from gapsense.studies.identification.device import Device, changed, value
from gapsense.studies.identification.record import Vector

FITTED = ("coil_turns", "core_reluctance", "core_saturation", "spring_stiffness", "damping", "mover_mass")
BOUND = 5.0  # the result lies within this factor of the first guess
WIDE = 300.0  # or within this one, if hardly anything is known of it
TABLE = ("gap_file_reluctance", "gap_file_slope")
FACTOR = "coil_factor"  # no parameter of the device, but one on the resistances of (23)
GUESSED = ("core_eddy", "core_hysteresis", "core_turnover", "gap_window")


class Form(NamedTuple):
    """The names that are fitted, from their values in `known` on; all else is held at its value there."""

    known: Device
    fitted: tuple[str, ...] = FITTED
    added: tuple[str, ...] = ()  # to the plain form, see `forms`

    def at(self, ratios: Vector) -> Device:
        """The fitted parameters multiplied by e^ratio, so that they stay positive; the others as they are known."""
        factors = zip(self.fitted, np.exp(ratios).tolist())
        return changed(self.known, **{n: x for name, f in factors for n, x in _multiplied(self.known, name, f)})

    @property
    def bounds(self) -> Vector:
        """Largest ratios."""
        return np.log([WIDE if name in GUESSED else BOUND for name in self.fitted])

    def factor(self, ratios: Vector) -> float:
        """On the resistances."""
        return float(np.exp(ratios[self.fitted.index(FACTOR)])) if FACTOR in self.fitted else 1.0

    def settled(self, ratios: Vector) -> Vector:
        """The ratios once the resistances have taken their factor."""
        return np.where([name == FACTOR for name in self.fitted], 0.0, ratios)

    @property
    def start(self) -> Vector:
        """Ratios of the first guess."""
        return np.zeros(len(self.fitted))

    def without(self, names: Collection[str], ratios: Vector) -> tuple[Form, Vector]:
        """The form that holds some of its parameters at the values that they have now, and its ratios."""
        free = [k for k, name in enumerate(self.fitted) if name not in names]
        now = self.at(ratios)
        known = changed(self.known, **{name: value(now, name) for name in self.fitted if name in names})
        return self._replace(known=known, fitted=tuple(self.fitted[k] for k in free)), ratios[free]


def _multiplied(par: Device, name: str, factor: float) -> list[tuple[str, Any]]:
    """A parameter times a factor; of the table of a gap law, both columns."""
    if name != TABLE[0]:
        return [(name, value(par, name) * factor)]
    return [(column, [factor * x for x in value(par, column)]) for column in TABLE]
