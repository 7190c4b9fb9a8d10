"""The loop of `RunToRun` with a law that it is given from outside, as a search needs it: a kernel.

Resistance and flux linkage are learnt as by the law `contact`; what that learns of the mover is overwritten.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.control import laws, run_to_run
from gapsense.control.records import CLOSING, OPENING, Inputs, Outputs, State
from gapsense.control.records import Parameters as Controller
from gapsense.kernels.layout import Scalar
from gapsense.kernels.linalg import vector

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]
NEVER = -1.0  # alarm: no operation is to be ordinary because one landed hard


class Parameters(NamedTuple):
    """A controller, and what it believes of the mover in each operation: logarithms, see `control.mover`."""

    controller: Controller
    closing_balance: Scalar  # a
    closing_tilt: Scalar  # b
    closing_lightness: Scalar  # q
    opening_balance: Scalar
    opening_tilt: Scalar
    opening_lightness: Scalar
    given_speed: Scalar  # of all approaches [m/s]


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """As `RunToRun`."""
    return run_to_run.initial(inputs, par.controller)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample of `RunToRun`, before which its laws are what is given; it never falls back."""
    closing = (par.closing_balance, par.closing_tilt, par.closing_lightness)
    opening = (par.opening_balance, par.opening_tilt, par.opening_lightness)
    known = state.laws
    for half, mean in ((CLOSING, closing), (OPENING, opening)):
        law = laws.read(known, half)._replace(mean=vector([*mean, 0.0]), speed=par.given_speed, missed=0.0)
        known = laws.write(known, half, law)
    return run_to_run.step(state._replace(laws=known, alarm=NEVER), inputs, par.controller)
