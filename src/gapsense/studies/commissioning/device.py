"""The model of `Mhe` from rest on, as a kernel: what the current of a device would be."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.mhe import Parameters
from gapsense.estimators.mhe_model import Point, advance, current, device, model, point
from gapsense.records import Scalar
from gapsense.trace import clip

State = Point

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


class Inputs(NamedTuple):
    """What drives it."""

    voltage: Scalar  # of the sample [V]


class Outputs(NamedTuple):
    """What it does."""

    current: Scalar
    position: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Without flux, on the stop to which the spring pushes."""
    d = device(par)
    at = point(0.0, 0.0, clip(d.rest, par.stop_lower, par.stop_upper), 0.0, inputs.voltage, model(par, d))
    return at, Outputs(0.0, at.position)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """The next sample."""
    m = model(par, device(par))
    at = advance(state, inputs.voltage, m)
    return at, Outputs(current(at, 0.5 * (state.voltage + inputs.voltage), m), at.position)
