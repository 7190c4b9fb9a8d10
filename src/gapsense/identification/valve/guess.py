"""Whether the first guess can lead to the device that was recorded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.flux import coil
from gapsense.identification.measurements.operations import operations
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.model import simulate
from gapsense.problems import InputError
from gapsense.report.table import quantity

FARTHEST = 10.0  # ratio of the inductances; the search stays within a factor of 5 of each parameter
PROBE = 1e-6  # voltage [V] and time [s] that bring hardly any flux


def check(known: Parameters, records: Sequence[Record], period: float | None = None) -> None:
    """Refuse records of a device that is another one than the guess; an InputError names them all."""
    guessed, problems = inductance(known), []
    for record in records:
        found = coil(record, operations(record, period)[0])[0]
        if not 1.0 / FARTHEST < found / guessed < FARTHEST:
            problems.append(
                f"{record.name}: its inductance is about {quantity(found, 'H')}, that of the first guess"
                f" {quantity(guessed, 'H')}: it is another device, which no search from there finds. Give a guess with"
                " `--parameters`, `coil.turns` and `core.reluctance` above all, or see what `gapsense inspect` tells."
            )
    if problems:
        raise InputError(problems)


def inductance(par: Parameters) -> float:
    """Of the valve at rest, without flux [H]."""
    halves, R = np.array([[0.0, 0.0], [PROBE, PROBE]]), np.full(2, par.coil_resistance)
    model = simulate(par, halves, PROBE, R)
    return float(model.flux_linkage[-1] / model.current[-1])
