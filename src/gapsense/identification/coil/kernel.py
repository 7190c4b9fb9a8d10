"""A coil whose core does not move, as a kernel: saturation by Froehlich, eddy currents, hysteresis by Dahl.

    i = (g_e u + f + h) / (1 + R g_e),   f = (r_a + r_c / (1 - |lambda| / lambda_s)) lambda,

with reluctances over N^2, r_a of what does not saturate and r_c of the core; `core_losses` has h and g_e.  That h grows
and turns over faster near saturation, as estimators have it, explains the records of a coil with a core less well.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.core_losses import Acting, Losses, advance_hysteresis, lossy
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import fabs, where

SATURATED = 0.95  # part of saturation from which the reluctance of the core is constant
NO_SATURATION = 1e9  # saturation that no flux linkage reaches [Wb]


class Parameters(NamedTuple):
    """A coil and its core."""

    sample_time: Scalar  # [s]
    resistance: Scalar  # R [ohm]
    air: Scalar  # r_a [1/H]
    core: Scalar  # r_c [1/H]
    saturation: Scalar  # lambda_s [Wb]
    eddy: Scalar  # g_e [S]
    hysteresis: Scalar  # I_h [A]
    turnover: Scalar  # l_h [Wb]


class State(NamedTuple):
    """What is carried from sample to sample."""

    flux_linkage: Scalar  # lambda [Wb]
    hysteresis: Scalar  # h [A]


class Inputs(NamedTuple):
    """Voltages that drive it [V]."""

    before: Scalar  # during the first half of the interval before the sample
    after: Scalar  # during its second half
    voltage: Scalar  # of the sample


class Outputs(NamedTuple):
    """What it does at the sample."""

    current: Scalar
    flux_linkage: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Without flux."""
    at = State(0.0, 0.0)
    return at, _outputs(at, inputs.voltage, par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """The next sample: in saturation the mean voltage would not do where it jumps."""
    at = _half(_half(state, inputs.before, par), inputs.after, par)
    return at, _outputs(at, inputs.voltage, par)


def _half(state: State, voltage: Scalar, par: Parameters) -> State:
    """Half an interval, by the method of Heun."""
    lam, dt, held = state.flux_linkage, 0.5 * par.sample_time, Acting(voltage, state.hysteresis)
    first = voltage - par.resistance * _current(lam, held, par)
    second = voltage - par.resistance * _current(lam + dt * first, held, par)
    change = 0.5 * dt * (first + second)
    return State(lam + change, advance_hysteresis(state.hysteresis, lam, change, _core(par)))


def _outputs(state: State, voltage: Scalar, par: Parameters) -> Outputs:
    held = Acting(voltage, state.hysteresis)
    return Outputs(_current(state.flux_linkage, held, par), state.flux_linkage)


def _current(lam: Scalar, held: Acting, par: Parameters) -> Scalar:
    x = fabs(lam) / par.saturation
    left = where(x < SATURATED, 1.0 - x, 1.0 - SATURATED)
    return lossy((par.air + par.core / left) * lam, lam, held, _core(par))


def _core(par: Parameters) -> Losses:
    return Losses(R=par.resistance, lam_sat=NO_SATURATION, eddy=par.eddy, amplitude=par.hysteresis, length=par.turnover)
