"""The model of `Mhe` from rest on, as a kernel: what the current of a device would be, on hard or on elastic stops.

A sampling period may be several steps, each with the mean of the voltage in it, so that an edge has its place and a
coarse record does not make the model coarse.

An elastic stop has the force k d (1 + b dd/dt) at the depth d, as that of `TableActuator` (Hunt and Crossley), and
never pulls.  For a step it is a spring of stiffness k (1 + b dd/dt) with its rest at the stop, which adds to that of
the mover.  A hard stop turns the speed round within the step, so that the trajectory has derivatives.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.mhe import model as mhe
from gapsense.estimators.mhe.model import LEAST_RETURN, Model, Point, advance, current, device, is_between, model, point
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, fabs, not_, where

FAR = 1.0  # m; where no stop is
State = Point


class Beyond(NamedTuple):
    """What the model of `Mhe` has not."""

    core_power: Scalar = 0.0  # n of a knee b m^n; 0: that of `Mhe`
    contact_stiffness: Scalar = 0.0  # k [N/m]; 0: hard stops
    contact_damping: Scalar = 0.0  # b [s/m]


USUAL = Beyond()


class Parameters(NamedTuple):
    """The actuator as `Mhe` knows it, and more."""

    known: mhe.Parameters
    beyond: Beyond = USUAL


class Inputs(NamedTuple):
    """What drives it."""

    voltage: Scalar  # mean over the step [V]


class Outputs(NamedTuple):
    """What it does."""

    current: Scalar
    flux_linkage: Scalar
    position: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Without flux, on the stop to which the spring pushes, as deep in it as that takes."""
    m, known, k = _model(par), par.known, par.beyond.contact_stiffness
    z = clip(m.d.rest, known.stop_lower, known.stop_upper)
    z = z + where(k > 0.0, m.stiffness * (m.d.rest - z), 0.0) / where(k > 0.0, m.stiffness + k, 1.0)
    at = point(0.0, 0.0, z, 0.0, inputs.voltage, _touching(z, 0.0, m, par))
    return at, Outputs(0.0, at.flux_linkage, at.position)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """The next step."""
    hard, u, p = _model(par), inputs.voltage, state
    v = p.velocity + hard.T_s * p.acceleration
    z = p.position + hard.T_s * (p.velocity + 0.5 * hard.T_s * p.acceleration)
    m = _touching(z, v, hard, par)
    at = advance(p._replace(voltage=u), u, m)
    before = _touching(p.position, p.velocity, hard, par)
    at = at._replace(velocity=at.velocity + _beside(p.position, z, before, m, par))
    at = _turn_round(p, z, at, m, par)
    return at, Outputs(current(at, u, m), at.flux_linkage, at.position)


def _touching(z: Scalar, v: Scalar, m: Model, par: Parameters) -> Model:
    """The model with what an elastic stop does to the mover at its position and speed in place of hard stops."""
    lower, upper, stops = par.known.stop_lower, par.known.stop_upper, par.beyond
    at = clip(z, lower, upper)
    firm = 1.0 + stops.contact_damping * where(z < lower, -v, v)
    k = where((z < lower) | (z > upper), stops.contact_stiffness * where(firm > 0.0, firm, 0.0), 0.0)
    rest = (m.stiffness * m.d.rest + k * at) / where(k > 0.0, m.stiffness + k, 1.0)
    is_elastic = stops.contact_stiffness > 0.0
    return m._replace(
        stiffness=m.stiffness + k,
        d=m.d._replace(rest=where(k > 0.0, rest, m.d.rest)),
        lower=where(is_elastic, -FAR, lower),
        upper=where(is_elastic, FAR, upper),
    )


def _beside(start: Scalar, end: Scalar, before: Model, after: Model, par: Parameters) -> Scalar:
    """Speed that the trapezoidal rule gives too little in a step that begins or ends on a stop, by its part there."""
    lower, upper = par.known.stop_lower, par.known.stop_upper
    depths = [z - clip(z, lower, upper) for z in (start, end)]
    k = before.stiffness + after.stiffness - 2.0 * par.known.spring_stiffness  # one of the two is in contact
    inside = depths[0] + depths[1]
    way = fabs(end - start)
    apart = where(way > fabs(inside), way - fabs(inside), 0.0) / where(way > 0.0, way, 1.0)
    crosses = (depths[0] == 0.0) & (fabs(depths[1]) > 0.0) | (depths[1] == 0.0) & (fabs(depths[0]) > 0.0)
    return where(crosses, 0.5 * par.known.sample_time * apart * k * inside / par.known.mover_mass, 0.0)


def _turn_round(p: Point, free: Scalar, at: Point, m: Model, par: Parameters) -> Point:
    """The same, after a hard stop from which the mover comes back; `free` is where it would be without the stop."""
    known, stop, T_s = par.known, at.position, m.T_s
    share = (stop - p.position) / where(free == p.position, 1.0, free - p.position)
    v = -known.stop_restitution * (p.velocity + share * T_s * p.acceleration)
    is_worth = v * v > 2.0 * LEAST_RETURN * (known.stop_upper - known.stop_lower) * fabs(at.acceleration)
    meets = is_between(p, m) & not_(free == stop) & not_(par.beyond.contact_stiffness > 0.0) & is_worth
    back = where(meets, (1.0 - share) * T_s * v, 0.0)
    return at._replace(
        position=stop + back,
        velocity=where(meets, v, at.velocity),
        reluctance=at.reluctance + at.slope * back,
        mmf=at.mmf + at.slope * back * at.flux_linkage,
    )


def _model(par: Parameters) -> Model:
    """The model without a rest that begins at a threshold, which no fit could take derivatives of."""
    known = par.known._replace(core_exponent=0.0)
    return model(known, device(known))._replace(
        quiet_voltage=0.0, quiet_current=0.0, bounces=False, exponent=par.beyond.core_power
    )
