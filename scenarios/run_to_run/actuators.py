"""Actuators that nobody has measured: each parameter of a plant is off by up to some percent, the same for a seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.fmi.components import kernel_parameters, own

Floats = npt.NDArray[np.float64]
STOPS = ("stop_lower", "stop_upper")  # wrong by half as much, both by the same factor
MOVER = ("mover_mass", "spring_stiffness", "spring_rest", "damping")
COMMON = ("coil_resistance", "gap_slope", "gap_fringing", "gap_window", *MOVER)
DOMAINS = ("core_magnetization", "core_pinning", "core_reversibility")  # with shape and coupling it may be unstable
CORE = ("core_length", "core_area", "core_eddy_conductance", *DOMAINS)
PLAYS = ("hysteresis_amplitude", "hysteresis_reach", "eddy_fast", "eddy_fast_time", "eddy_slow", "eddy_slow_time")
WRONG = {  # of each plant; turns are known exactly
    "reluctance_actuator": (*COMMON, *CORE),
    "play_actuator": (*COMMON, "core_reluctance", "core_saturation", *PLAYS),
}


def factors(seed: int, run: int, count: int, width: float, kind: str = "uniform") -> Floats:
    """Factors of the stops and of `count` parameters of one actuator; other actuators do not change them."""
    chance = np.random.default_rng([seed, run])
    errors = chance.uniform(-width, width, 1 + count) if kind == "uniform" else chance.normal(0.0, width, 1 + count)
    return np.asarray(1.0 + errors * np.r_[0.5, np.ones(count)])


def drawn(plant: str, seed: int, runs: range, width: float, kind: str = "uniform") -> dict[str, Any]:
    """Parameters of actuators: a number that all have, or one for each (runs,); tables are lists."""
    wrong = WRONG[plant]
    par: Mapping[str, Any] = kernel_parameters(own(plant), {})._asdict()
    stops, *others = np.array([factors(seed, run, len(wrong), width, kind) for run in runs]).T
    made = {name: par[name] * factor for name, factor in zip(wrong, others)}
    made |= {name: par[name] * stops for name in STOPS}
    return {**par, **made, "initial_position": made["stop_upper"]}
