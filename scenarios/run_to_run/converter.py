"""A converter that integrates: it tells means of voltage and current since the last sample, no ripple: a kernel."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import where


class Parameters(NamedTuple):
    """How often it is stepped from sample to sample."""

    parts: Scalar


class State(NamedTuple):
    """What has come since the last sample."""

    count: Scalar  # of the parts of a sample so far
    volts: Scalar  # their sum [V]
    amperes: Scalar  # sum of the currents in their middle [A]
    last: Scalar  # current [A]
    mean_voltage: Scalar  # of the last sample [V]
    mean_current: Scalar  # [A]


class Inputs(NamedTuple):
    """Mean voltage of a part of a sample, and the current at its end."""

    voltage: Scalar
    current: Scalar


class Outputs(NamedTuple):
    """Means of the last sample that is complete."""

    voltage: Scalar
    current: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """It has always been so."""
    del par
    state = State(
        count=0.0, volts=0.0, amperes=0.0, last=inputs.current, mean_voltage=inputs.voltage, mean_current=inputs.current
    )
    return state, Outputs(inputs.voltage, inputs.current)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """A part of a sample."""
    count, volts = state.count + 1.0, state.volts + inputs.voltage
    amperes = state.amperes + 0.5 * (state.last + inputs.current)
    is_complete = count >= par.parts
    left = where(is_complete, 0.0, 1.0)
    sums = ((volts, state.mean_voltage), (amperes, state.mean_current))
    outputs = Outputs(*(where(is_complete, total / par.parts, before) for total, before in sums))
    return State(left * count, left * volts, left * amperes, inputs.current, *outputs), outputs
