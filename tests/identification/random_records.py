"""Random records of the valve with random disturbances, as people bring them: a study of stated errors and causes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from imperfect_records import ON, PERIOD, Condition, records
from valve_records import GUESS

from gapsense.identification.options import CONVENTIONS
from gapsense.identification.valve.fit import Identified, fit_valve
from gapsense.identification.valve.form import value_of
from gapsense.studies.devices import VALVE

Draw = Callable[[np.random.Generator], dict[str, float]]
DISTURBANCES: dict[str, tuple[Draw, str]] = {  # what is drawn, and what is said of it where a record is refused
    "none": (lambda rng: {}, ""),
    "late": (lambda rng: {"skew": rng.uniform(5e-6, 40e-6)}, "late"),
    "both filtered": (lambda rng: {"blurred": rng.uniform(8e-6, 80e-6), "order": rng.choice([1, 2])}, "edges|filter"),
    "offset": (lambda rng: {"offset": rng.uniform(-8e-3, 8e-3)}, "offset"),
    "noise": (lambda rng: {"noise": rng.uniform(1.0, 8.0)}, ""),
    "hum": (lambda rng: {"hum": rng.uniform(0.5e-3, 3e-3)}, "hum"),
    "drops": (lambda rng: {"series": rng.uniform(0.5, 3.0), "only_command": 1.0}, "drop|series|voltage that is not"),
    "eddy": (lambda rng: {"eddy": rng.uniform(1e-4, 1e-3)}, "losses"),
    "warming": (lambda rng: {"warming": rng.uniform(0.0, 0.3)}, "warm|drift|resistance"),
    "slow samples": (lambda rng: {"dt": rng.choice([20e-6, 80e-6])}, "edges"),
}


def draw(seed: int) -> tuple[str, Condition]:
    """A disturbance, and edges anywhere between two samples."""
    rng = np.random.default_rng(seed)
    name = [*DISTURBANCES][int(rng.integers(len(DISTURBANCES)))]
    drive = {"period": PERIOD + rng.uniform(0.0, 1e-4), "on": ON + rng.uniform(0.0, 1e-4), "edge": rng.uniform()}
    return name, Condition(**{**drive, **DISTURBANCES[name][0](rng)})


def identified(c: Condition, seed: int) -> Identified:
    """What is found from one start."""
    return fit_valve(records(c, seed), GUESS, 1, conventions=CONVENTIONS)


def off(c: Condition, result: Identified) -> dict[str, float]:
    """Errors of what is called identified, in stated standard errors."""
    found = {}
    for field, error in zip(result.names, result.uncertainty.relative.tolist()):
        true = {"core_eddy": c.eddy, "current_filter": c.filtered}.get(field, getattr(VALVE, field, 0.0))
        most = true * (1.0 + c.warming) if field == "coil_resistance" else true
        at = float(value_of(result.parameters, field))
        if field not in result.poor:
            found[field] = (at / float(np.clip(at, true, most)) - 1.0) / error if true else float("inf")
    return found
