"""Signals on the way from part to part, with errors of the voltage and something added to the current: a kernel."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.kernels.layout import Scalar


class Parameters(NamedTuple):
    """Errors of the voltage."""

    gain: Scalar  # [1]
    offset: Scalar  # [V]


class State(NamedTuple):
    """Nothing is remembered."""

    nothing: Scalar


class Inputs(NamedTuple):
    """Signals as they are, and what comes to the current."""

    voltage: Scalar
    current: Scalar
    added: Scalar


class Outputs(NamedTuple):
    """Signals as they arrive."""

    voltage: Scalar
    current: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """As at any sample."""
    return step(State(0.0), inputs, par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample."""
    return state, Outputs(par.gain * inputs.voltage + par.offset, inputs.current + inputs.added)
