"""The complete model of [RTS] solved backwards: what voltage moves the actuator along a given position.

position -> magnetic force (11) -> flux (12) -> field of the core, along the flux (10) -> current (2) -> voltage (1)

Position, force and flux are algebra; only the core is integrated.  The kernel functions of the actuator are used as
they are, on floats.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from gapsense.actuators import hysteresis, magnetics, motion
from gapsense.actuators.reluctance_steps import Actuator
from gapsense.studies.soft_landing.trajectory import Mechanics, Motion, mechanics

Vector = npt.NDArray[np.float64]
SHORTEST = 50  # steps per motion at least, in the integration of the core
RELATIVE, ABSOLUTE = 1e-12, 1e-9  # tolerances of the effective field [A/m]


class SoftLandingError(ValueError):
    """A motion that this actuator cannot make."""


class Row(NamedTuple):
    """The motion and what it takes, at one instant."""

    time: float
    voltage: float
    position: float
    velocity: float
    acceleration: float
    flux: float
    effective_field: float
    core_field: float
    current: float


class Flux(NamedTuple):
    """The flux that the motion needs at one instant, and what the circuit then is."""

    flux: float
    rate: float
    reluctance: float


def flux_for(x: Mechanics, act: Actuator) -> tuple[float, float, float]:
    """Square of the flux, its rate, and the reluctance of the gap: (11) and (12) solved for the flux.

    A negative square means that the magnet would have to push.
    """
    mover = act.mover
    reluctance, slope, curvature = magnetics.smooth_gap_law(x.position, act.gap)
    force = mover.mass * x.acceleration + mover.damping * x.velocity - motion.spring_force(x.position, mover)
    force_rate = mover.mass * x.jerk + mover.damping * x.acceleration + mover.stiffness * x.velocity
    square = -2.0 * force / slope
    return square, -(2.0 * force_rate + square * curvature * x.velocity) / slope, reluctance


def needed_flux(t: float, m: Motion, act: Actuator) -> Flux:
    """Flux and its rate at time `t` of the motion."""
    x = mechanics(t, m)
    square, square_rate, reluctance = flux_for(x, act)
    if square <= 0.0:
        raise SoftLandingError(
            f"t = {t:.6g} s, gap {x.position:.6g} m: the magnet would have to push (the spring and the damper alone "
            f"accelerate the mover less than the {x.acceleration:.4g} m/s2 of the trajectory); it can only pull. Make "
            f"the duration of this motion longer than {m.duration} s, or the spring stronger."
        )
    flux = math.sqrt(square)
    return Flux(flux, 0.5 * square_rate / flux, reluctance)


def follow(m: Motion, H_e: float, act: Actuator, times: Vector) -> list[Row]:
    """Rows at `times`, which begin and end with the motion.

    Parameters
    ----------
    m : Motion
        What the position shall be.
    H_e : float
        Effective field of the core at the start [A/m], its memory of what was before.
    act : Actuator
        Constants of the actuator; its voltage is of no importance.
    times : (n,) array
        Not decreasing, dense enough that the flux turns round at most once between two of them [s].
    """
    fluxes = [needed_flux(t, m, act) for t in times.tolist()]
    fields = _along(lambda t: needed_flux(t, m, act), H_e, act, times, np.array([f.rate for f in fluxes]))
    return [_row(t, m, flux, field, act) for t, flux, field in zip(times.tolist(), fluxes, fields.tolist())]


def _row(t: float, m: Motion, flux: Flux, field: float, act: Actuator) -> Row:
    H_e, x = hysteresis.settled(flux.flux, field, act.core), mechanics(t, m)
    H_c = core_field(flux.flux, H_e, act)
    i = current(flux, H_c, act)
    voltage = act.resistance * i + act.turns * flux.rate  # (1)
    return Row(t, voltage, x.position, x.velocity, x.acceleration, flux.flux, H_e, H_c, i)


def current(flux: Flux, H_c: float, act: Actuator) -> float:
    """Current of the coil (2), with that of the eddies (3) [A]."""
    mmf = flux.reluctance * flux.flux + H_c * act.core.length  # (5) and (6)
    return float((mmf + act.eddy * flux.rate) / act.turns)


def core_field(flux: float, H_e: float, act: Actuator) -> float:
    """H_c [A/m]."""
    return float(H_e - act.core.coupling * hysteresis.magnetization(flux, H_e, act.core))


def _along(
    flux_at: Callable[[float], Flux], H_e: float, act: Actuator, times: Vector, rates: Vector
) -> npt.NDArray[np.float64]:
    """Effective field at `times`, integrated between the instants at which the flux turns round."""
    turns = [
        brentq(lambda t: flux_at(t).rate, times[k], times[k + 1], xtol=1e-15)
        for k in np.flatnonzero(rates[:-1] * rates[1:] < 0.0)
    ]
    ends, found = [*turns, times[-1]], np.full(times.size, H_e)
    start = times[0]
    for end in ends:
        delta = math.copysign(1.0, flux_at(0.5 * (start + end)).rate)

        def rate(t: float, y: Vector, delta: float = delta) -> list[float]:
            flux, (field,) = flux_at(t), y.tolist()
            excess, steepness = _excess(flux.flux, field, act)
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


def _excess(flux: float, H_e: float, act: Actuator) -> tuple[float, float]:
    """M_an - M and the steepness of M_an."""
    M_an, steepness = hysteresis.anhysteretic(H_e, act.core)
    return M_an - hysteresis.magnetization(flux, H_e, act.core), steepness
