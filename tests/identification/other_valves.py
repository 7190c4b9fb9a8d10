"""Valves with other stops, another gap slope and another spring than [SEMERA] Table I, and what users know of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from valve_records import record

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.valve import fit
from gapsense.identification.valve.fit import Identified
from gapsense.identification.valve.form import Sought, guess_similar, value_of
from gapsense.studies.devices import VALVE

SCALES = ("stop_lower", "stop_upper", "spring_rest", "gap_slope")
KNOWLEDGE = {"nothing": (), "all": SCALES, "no spring": ("stop_lower", "stop_upper", "gap_slope"),
             "no stops": ("gap_slope", "spring_rest"), "no gap law": SCALES[:3], "roughly": SCALES}  # fmt: skip
ROUGH, WIDE = 0.05, 3.0**0.5  # standard error of what is known roughly; bounds of errors that have it


class Case(NamedTuple):
    """A valve and what was found of it."""

    truth: Parameters
    result: Identified

    @property
    def z(self) -> dict[str, float]:
        """Errors of the logarithms of the fitted parameters, in standard errors."""
        errors = dict(zip(self.result.names, self.result.uncertainty.relative.tolist()))
        off = {name: np.log(value_of(self.result.parameters, name) / getattr(self.truth, name)) for name in errors}
        return {name: float(off[name] / errors[name]) for name in errors if np.isfinite(errors[name])}


def valve(rng: np.random.Generator) -> Parameters:
    """A stroke of 0.4 to 1.8 mm, a relaxed gap of 2 to 30 of them, a residual gap of up to a tenth in half of them."""
    while True:
        stroke, slope = (float(np.exp(rng.uniform(*np.log(limits)))) for limits in ((0.4e-3, 1.8e-3), (1e10, 6e10)))
        lower = stroke * max(0.0, rng.uniform(-0.1, 0.1))
        upper = lower + stroke
        par = VALVE._replace(stop_lower=lower, stop_upper=upper, initial_position=upper, gap_slope=slope)
        par = par._replace(spring_rest=upper + stroke * float(np.exp(rng.uniform(*np.log((1.0, 30.0))))))
        like = guess_similar(par, SCALES)
        preload = like.spring_stiffness * (par.spring_rest - 0.5 * (lower + upper)) * rng.uniform(0.7, 1.1)
        factors = {"coil_turns": 0.15, "core_reluctance": 0.3, "mover_mass": 0.3, "damping": 0.3}
        changes = {name: getattr(like, name) * rng.uniform(1.0 - f, 1.0 + f) for name, f in factors.items()}
        par = like._replace(**changes, spring_stiffness=preload / (par.spring_rest - 0.5 * (lower + upper)))
        if all(np.ptp(moved(par, volts)) > 0.99 * stroke for volts in (30.0, 24.0)):
            return par


def moved(par: Parameters, volts: float):
    """Positions of an operation."""
    return record(periods=1, volts=volts, par=par, gap_noise=0.0).position


def case(seed: int, knowledge: str) -> Case:
    """What is found of the valve of a seed by somebody who knows so much."""
    rng = np.random.default_rng(7000 + seed)
    truth, given = valve(rng), {*KNOWLEDGE[knowledge], "stop_restitution"}
    off = {name: ROUGH * rng.uniform(-WIDE, WIDE) if knowledge == "roughly" else 0.0 for name in SCALES}
    accuracy = {name: ROUGH for name in SCALES[1:] if knowledge == "roughly"}
    told = {name: getattr(truth, name) * float(np.exp(off[name])) for name in SCALES if name in given}
    known = guess_similar(VALVE._replace(**told), given)
    sought = Sought((), given=given, accuracy=accuracy)
    return Case(truth, fit.fit_valve(records(truth, seed), known, 3, sought=sought))


def records(truth: Parameters, seed: int):
    """Two records of two operations each, with 1 mA of noise."""
    return [record(periods=2, volts=volts, par=truth, seed=10 * seed + k) for k, volts in enumerate((30.0, 24.0))]
