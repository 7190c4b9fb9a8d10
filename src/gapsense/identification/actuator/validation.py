"""How well a commissioned model predicts records that were not used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapsense.estimators.mhe.model import Parameters
from gapsense.identification.actuator.drive import drive
from gapsense.identification.actuator.minimise import minimised
from gapsense.identification.actuator.problem import Problem, simulate
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.validation import Validation, compared


def validated(par: Parameters, records: Sequence[Record]) -> list[Validation]:
    """The model beside each of some records; only offsets and the places of edges are sought."""
    return [validate(par, record) for record in records]


def validate(par: Parameters, record: Record) -> Validation:
    """Beside one of them."""
    driven = drive(record, par)
    p = Problem(par, [], [driven])
    x = minimised(p, np.zeros(p.deviations.size))
    return compared(record, simulate(par, driven, p.places(x)[0], p.offsets(x)[0]), driven.first)
