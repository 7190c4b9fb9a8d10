"""A contact that is told late, by a number of samples: a kernel."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.kernels.layout import Array, Scalar, Vector
from gapsense.kernels.linalg import vector
from gapsense.kernels.trace import where

LATEST = 8  # samples


class Parameters(NamedTuple):
    """How late."""

    samples: Scalar  # 0 to `LATEST`


class State(NamedTuple):
    """The samples before, the last one first."""

    modes: Annotated[Array, Vector(LATEST)]


class Inputs(NamedTuple):
    """What is so now."""

    mode: Scalar


class Outputs(NamedTuple):
    """What is told."""

    mode: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """It has always been so."""
    del par
    return State(vector([inputs.mode] * LATEST)), Outputs(inputs.mode)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample."""
    told = inputs.mode
    for k, mode in enumerate(state.modes, 1):
        told = where(par.samples == k, mode, told)
    return State(vector([inputs.mode, *state.modes[:-1]])), Outputs(told)
