"""The solenoid valve with eddy currents and hysteresis in its core, around the kernel of the valve without them.

Both are those of the estimators, see `core_losses`: with a magnetising current i_m that the valve needs,

    i = (g_e u + i_m + h (1 + m^2)) / (1 + R g_e),    dlambda/dt = (u - R (i_m + h (1 + m^2))) / (1 + R g_e).

So it is the valve without losses, at another voltage and another resistance.  Of h that voltage has the mean over the
step, as far as its change of the flux linkage can be foreseen: at 50 us the error of the current is below 1 % of I_h.
Near saturation the flux linkage settles within a step, and foresight must see that, or h would swing.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.actuators import solenoid_valve
from gapsense.actuators.magnetics import SATURATED
from gapsense.actuators.solenoid_valve import Inputs
from gapsense.estimators.core_losses import SHORTER, SHORTEST, Acting, Losses, advance_hysteresis, lossy, share
from gapsense.kernels.elementary import exp
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import fabs, square, where

SLOW = 1e-4  # part of a time constant up to which a mean is that of the ends
TINY = 1e-9  # flux linkage, relative to saturation, that counts as none

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


class Parameters(NamedTuple):
    """The valve, and what its core loses."""

    valve: solenoid_valve.Parameters
    core_eddy: Scalar  # g_e [S]
    core_hysteresis: Scalar  # I_h, largest h [A]
    core_turnover: Scalar  # l_h, flux linkage in which h turns over [Wb]
    coil_factor: Scalar  # of the resistance; (23) is wrong where the core stays magnetised [1]
    core_remanence: Scalar = 0.0  # what is left of I_h at the start, as after an operation: 0 to 1 [1]
    current_filter: Scalar = 0.0  # time constant of a low-pass of the current alone, see `model.simulate` [s]


class State(NamedTuple):
    """What is carried from step to step."""

    valve: solenoid_valve.State
    magnetising: Scalar  # i_m [A]
    hysteresis: Scalar  # h [A]


class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar
    flux_linkage: Scalar
    position: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without current, with the flux that hysteresis keeps."""
    valve, seen = solenoid_valve.initial(inputs, par.valve)
    left = par.core_remanence * par.core_hysteresis
    lam = left * seen.inductance
    return State(valve._replace(flux_linkage=lam), left, -left), Outputs(0.0, lam, seen.position)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """The step of the valve at the voltage that the losses leave."""
    core = _core(par)
    left = share(core)
    lam, h, u = state.valve.flux_linkage, state.hysteresis, inputs.voltage
    ahead = inputs.dt * left * (u - core.R * (state.magnetising + _force(lam, h, core)))
    stiff = inputs.dt * left * core.R * _rate(state, ahead, core, par.valve)
    ahead = ahead * _lag(where(stiff > 1.0, stiff - 1.0, 0.0))
    middle = lam + 0.5 * ahead
    lost = core.R * _force(middle, _mean(h, middle, ahead, core), core)
    within = par.valve._replace(coil_resistance=core.R * left)
    valve, seen = solenoid_valve.step(state.valve, inputs._replace(voltage=(u - lost) * left), within)
    change = seen.flux_linkage - lam
    h = advance_hysteresis(h, lam + 0.5 * change, change, core)
    current = lossy(seen.current, seen.flux_linkage, Acting(u, h), core)
    return State(valve, seen.current, h), Outputs(current, seen.flux_linkage, seen.position)


def _core(par: Parameters) -> Losses:
    R = par.coil_factor * par.valve.coil_resistance
    return Losses(
        R=R,
        lam_sat=par.valve.core_saturation,
        eddy=par.core_eddy,
        amplitude=par.core_hysteresis,
        length=par.core_turnover,
    )


def _force(lam: Scalar, h: Scalar, core: Losses) -> Scalar:
    """What hysteresis adds to the magnetomotive force over N [A]."""
    return h * (1.0 + square(lam / core.lam_sat))


def _rate(state: State, change: Scalar, core: Losses, valve: solenoid_valve.Parameters) -> Scalar:
    """How fast the current changes with the flux linkage while the gap stays [1/H], at the flatter end of a change."""
    lam, h = state.valve.flux_linkage, state.hysteresis
    one, other = (fabs(at / core.lam_sat) for at in (lam, lam + change))
    m = where(one < other, one, other)
    before, after = (1.0 - where(x < SATURATED, x, SATURATED) for x in (one, m))
    is_there, own = one > TINY, valve.core_reluctance / square(valve.coil_turns)
    gap = where(is_there, state.magnetising / where(is_there, lam, 1.0) - own / before, 0.0)
    return (
        gap + own / square(after) + fabs(_end(change, core) - h) * (1.0 + square(m)) / _length(m * core.lam_sat, core)
    )


def _end(change: Scalar, core: Losses) -> Scalar:
    """Value of h in the end."""
    return where(change >= 0.0, core.amplitude, -core.amplitude)


def _length(lam: Scalar, core: Losses) -> Scalar:
    """Flux linkage in which h turns over there [Wb]."""
    rest = 1.0 - SHORTER * square(lam / core.lam_sat)
    return core.length * where(rest > SHORTEST, rest, SHORTEST)


def _mean(h: Scalar, lam: Scalar, change: Scalar, core: Losses) -> Scalar:
    """Mean of h while the flux linkage changes by `change` around `lam`."""
    end = _end(change, core)
    return end + (h - end) * _lag(fabs(change) / _length(lam, core))


def _lag(x: Scalar) -> Scalar:
    """Mean of exp(-z) for z from 0 to x."""
    is_slow = x < SLOW
    return where(is_slow, 1.0 - 0.5 * x, (1.0 - exp(-x)) / where(is_slow, 1.0, x))
