"""What an identification of a valve has found, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.flux import Flux
from gapsense.identification.measurements.record import Vector
from gapsense.identification.residual import Residual
from gapsense.identification.valve.device import Device, value
from gapsense.identification.valve.errors import Uncertainty
from gapsense.identification.valve.evidence import Trial
from gapsense.identification.valve.form import FACTOR, GUESSED, SHAPE, Form
from gapsense.identification.valve.minimise import Start
from gapsense.identification.valve.model import Trajectory

POOR = 0.05  # relative standard error from which a parameter counts as not identifiable
ROUGH = 0.3  # the same of what hardly anything was known of


class Identified(NamedTuple):
    """What was found, and how."""

    parameters: Device  # complete set, known ones included
    form: Form  # what was sought
    uncertainty: Uncertainty  # in that order
    cost: float  # J of (24)
    starts: list[Start]  # empty for the multi-directional search
    evaluations: int  # simulations of all records; a shorter one counts in proportion
    fluxes: list[Flux]  # resistances and flux linkage of each record
    models: list[Trajectory]  # what the model does, from the first operation of each record on
    convention: str  # the voltage between samples, see `record.halves`
    residuals: list[Residual]  # of each record
    ratios: Vector  # logarithms, of the fitted parameters to their first guesses
    trials: list[Trial]  # forms that were tried
    drive: Mapping[str, float] = {}  # values of the causes that were taken out of the records, see `causes`
    held: Sequence[str] = ()  # parameters that turned out not to be identified, and were held
    assumed: Mapping[str, float] = {}  # fields that were neither given nor found, and the doubt about their values

    @property
    def names(self) -> tuple[str, ...]:
        """The fitted parameters, and the resistance."""
        return (*(n for n in self.form.fitted if n != FACTOR and not n.startswith(SHAPE)), "coil_resistance")

    @property
    def resistance(self) -> float:
        """Of all records [Ohm]."""
        return float(value(self.parameters, "coil_resistance"))

    @property
    def is_explained(self) -> bool:
        """Whether the model explains all records."""
        return all(residual.is_explained for residual in self.residuals)

    @property
    def at_bounds(self) -> list[str]:
        """Parameters at a limit of the search."""
        is_there = np.abs(self.ratios) > 0.999 * self.form.bounds
        return [name for name, there in zip(self.form.fitted, is_there) if there and name in self.names]

    @property
    def poor(self) -> list[str]:
        """Parameters that the records do not identify."""
        errors = zip(self.names, self.uncertainty.relative)
        return [name for name, error in errors if not error < (ROUGH if name in GUESSED else POOR)]

    def with_held(self, held: Sequence[str], before: Identified) -> Identified:
        """What was held is no more certain for it: errors are no smaller than those of the fit `before`."""
        errors = dict(zip(before.names, before.uncertainty.relative.tolist()))
        least = np.array([errors[name] for name in self.names])
        wider = self.uncertainty._replace(relative=np.maximum(self.uncertainty.relative, least))
        return self._replace(held=held, uncertainty=wider)
