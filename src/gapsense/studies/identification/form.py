"""What is sought of a valve, and what is held: the form of the model that is fitted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.studies.identification.record import Vector

FITTED = ("coil_turns", "core_reluctance", "core_saturation", "spring_stiffness", "damping", "mover_mass")
BOUND = 5.0  # the result lies within this factor of the first guess


class Form(NamedTuple):
    """The names that are fitted, from their values in `known` on; all else is held at its value there."""

    known: Parameters
    fitted: tuple[str, ...] = FITTED

    def at(self, ratios: Vector) -> Parameters:
        """The fitted parameters multiplied by e^ratio, so that they stay positive; the others as they are known."""
        factors = np.exp(ratios).tolist()
        return self.known._replace(**{name: getattr(self.known, name) * f for name, f in zip(self.fitted, factors)})

    @property
    def bounds(self) -> Vector:
        """Largest ratios."""
        return np.full(len(self.fitted), np.log(BOUND))

    @property
    def start(self) -> Vector:
        """Ratios of the first guess."""
        return np.zeros(len(self.fitted))
