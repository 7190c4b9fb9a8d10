"""The model of `Mhe` from rest on, as a kernel: what the current of a device would be.

A sampling period may be several steps, each with the mean of the voltage in it, so that an edge has its place and a
coarse record does not make the model coarse.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.mhe.model import Device, Model, Parameters, Point, advance, current, device, model, point
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip

State = Point

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


class Inputs(NamedTuple):
    """What drives it."""

    voltage: Scalar  # mean over the step [V]


class Outputs(NamedTuple):
    """What it does."""

    current: Scalar
    flux_linkage: Scalar
    position: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Without flux, on the stop to which the spring pushes."""
    d = device(par)
    at = point(0.0, 0.0, clip(d.rest, par.stop_lower, par.stop_upper), 0.0, inputs.voltage, _model(par, d))
    return at, Outputs(0.0, at.flux_linkage, at.position)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """The next step."""
    m, u = _model(par, device(par)), inputs.voltage
    at = advance(state._replace(voltage=u), u, m)
    return at, Outputs(current(at, u, m), at.flux_linkage, at.position)


def _model(par: Parameters, d: Device) -> Model:
    """The model without a rest that begins at a threshold, which no fit could take derivatives of."""
    return model(par, d)._replace(quiet_voltage=0.0, quiet_current=0.0)
