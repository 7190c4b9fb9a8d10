"""The complete model of [RTS] solved backwards: what voltage moves the actuator along a given position.

position -> magnetic force (11) -> flux (12) -> field of the core, along the flux (10) -> current (2) -> voltage (1)

Position, force and flux are algebra; only the core is integrated.  The kernel functions of the actuator are used as
they are, on floats.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from gapsense.actuators import hysteresis, magnetics, motion
from gapsense.actuators.reluctance_steps import Actuator

from .trajectory import Motion, mechanics

Vector = npt.NDArray[np.float64]
SHORTEST = 50  # steps per motion at least, in the integration of the core
RELATIVE, ABSOLUTE = 1e-12, 1e-9  # tolerances of the effective field [A/m]


class SoftLandingError(ValueError):
    """A motion that this actuator cannot make."""


class Cycle(NamedTuple):
    """One period, arrays (n,); at the ends of the phases, where the voltage may jump, a time comes twice."""

    time: Vector
    voltage: Vector
    position: Vector
    velocity: Vector
    acceleration: Vector
    flux: Vector
    effective_field: Vector
    core_field: Vector
    current: Vector
    mode: Vector
    flux_linkage: Vector


class Flux(NamedTuple):
    """The flux that the motion needs at one instant, and what the circuit then is."""

    flux: float
    rate: float
    reluctance: float


def needed_flux(t: float, m: Motion, act: Actuator) -> Flux:
    """Flux and its rate at time `t` of the motion: (11) and (12) solved for the flux."""
    x, mover = mechanics(t, m), act.mover
    reluctance, slope, curvature = magnetics.smooth_gap_law(x.position, act.gap)
    force = mover.mass * x.acceleration + mover.damping * x.velocity - motion.spring_force(x.position, mover)
    force_rate = mover.mass * x.jerk + mover.damping * x.acceleration + mover.stiffness * x.velocity
    square = -2.0 * force / slope
    if square <= 0.0:
        raise SoftLandingError(
            f"t = {t:.6g} s, gap {x.position:.6g} m: the magnet would have to push (the spring and the damper alone "
            f"accelerate the mover less than the {x.acceleration:.4g} m/s2 of the trajectory); it can only pull. Make "
            f"the duration of this motion longer than {m.duration} s, or the spring stronger."
        )
    flux, square_rate = math.sqrt(square), -(2.0 * force_rate + square * curvature * x.velocity) / slope
    return Flux(flux, 0.5 * square_rate / flux, reluctance)


def follow(m: Motion, H_e: float, act: Actuator, times: Vector) -> Cycle:
    """Rows at `times` [s] from the beginning of a motion to its end, with all that it takes.

    The core starts with the effective field `H_e` [A/m], its memory of what was before.  The times do not decrease, and
    are so dense that the flux turns round at most once between two of them.
    """
    flux_at = partial(needed_flux, m=m, act=act)
    fluxes = [flux_at(t) for t in times.tolist()]
    fields = _along(flux_at, H_e, act, times, np.array([f.rate for f in fluxes]))
    rows = [_row(t, m, flux, field, act) for t, flux, field in zip(times.tolist(), fluxes, fields.tolist())]
    return Cycle(*np.array(rows).T)


def _row(t: float, m: Motion, flux: Flux, field: float, act: Actuator) -> tuple[float, ...]:
    """What a `Cycle` has at one instant."""
    H_e, x = hysteresis.settle_field(flux.flux, field, act.core), mechanics(t, m)
    H_c = H_e - act.core.coupling * hysteresis.magnetization(flux.flux, H_e, act.core)
    mmf = flux.reluctance * flux.flux + H_c * act.core.length  # (5) and (6)
    i = (mmf + act.eddy * flux.rate) / act.turns  # (2), with the current of the eddies (3)
    u, linkage = act.resistance * i + act.turns * flux.rate, act.turns * flux.flux  # (1)
    return t, u, x.position, x.velocity, x.acceleration, flux.flux, H_e, H_c, i, motion.MOVING, linkage


def _along(flux_at: Callable[[float], Flux], H_e: float, act: Actuator, times: Vector, rates: Vector) -> Vector:
    """Effective field at `times`, integrated between the instants at which the flux turns round."""
    turns = [
        brentq(lambda t: flux_at(t).rate, times[k], times[k + 1], xtol=1e-15)
        for k in np.flatnonzero(rates[:-1] * rates[1:] < 0.0)
    ]
    found, start = np.full(times.size, H_e), times[0]
    for end in (*turns, times[-1]):
        delta = math.copysign(1.0, flux_at(0.5 * (start + end)).rate)

        def rate(t: float, y: Vector, delta: float = delta) -> list[float]:
            """Rate of the effective field that gives this flux."""
            flux, (field,) = flux_at(t), y.tolist()
            M_an, steepness = hysteresis.anhysteretic(field, act.core)
            excess = M_an - hysteresis.magnetization(flux.flux, field, act.core)
            # an excess against the direction of the flux counts as none: these walls are frozen
            chi = hysteresis.susceptibility(excess, steepness, delta, act.core)
            return [hysteresis.field_rate(flux.rate, chi, act.core)]

        part = solve_ivp(
            rate, (start, end), [H_e], "DOP853", rtol=RELATIVE, atol=ABSOLUTE, dense_output=True,
            max_step=(times[-1] - times[0]) / SHORTEST,
        )  # fmt: skip
        inside = (times > start) & (times <= end)
        if inside.any():
            found[inside] = part.sol(times[inside])[0]
        start, H_e = end, float(part.y[0, -1])
    return found
