"""A kernel: the reluctance actuator under a voltage that is held, by feedback of its true flux linkage."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.actuators import reluctance_actuator as actuator
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, where

Parameters = actuator.Parameters
GAIN, MOST = 0.04, 30.0  # of the feedback, times the sampling period [Wb to V s]; voltage of the bridge, both ways


class State(NamedTuple):
    act: actuator.State
    last_current: Scalar
    last_flux: Scalar


class Inputs(NamedTuple):
    """Of the sampling period that ends at `time`."""

    time: Scalar
    dt: Scalar
    follows: Scalar  # 1: the flux linkage is to follow its reference; 0: the level is the voltage
    reference: Scalar  # flux linkage at the start of the period
    rate: Scalar  # of the reference [V]
    level: Scalar  # [V]


class Outputs(NamedTuple):
    voltage: Scalar  # held since the last sample
    current: Scalar
    position: Scalar
    velocity: Scalar
    mode: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    act, seen = actuator.initial(actuator.Inputs(inputs.time, inputs.dt, 0.0), par)
    return State(act, seen.current, seen.flux_linkage), _shown(0.0, seen)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    missing = GAIN / inputs.dt * (inputs.reference - state.last_flux)
    u = inputs.rate + par.coil_resistance * state.last_current + missing
    u = clip(where(inputs.follows > 0.0, u, inputs.level), -MOST, MOST)
    act, seen = actuator.step(state.act, actuator.Inputs(inputs.time, inputs.dt, u), par)
    return State(act, seen.current, seen.flux_linkage), _shown(u, seen)


def _shown(u: Scalar, seen: actuator.Outputs) -> Outputs:
    return Outputs(u, seen.current, seen.position, seen.velocity, seen.mode)
