"""One micro-step of the solenoid valve: flux and motion, up to the next contact or release."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from gapsense.actuators import magnetics, motion
from gapsense.actuators.magnetics import Circuit
from gapsense.actuators.motion import CLOSED, MOVING, OPEN, Mover
from gapsense.integrate import crossing, least, next_part, rk4, rk4_until
from gapsense.records import Scalar
from gapsense.trace import cond, loop, not_, square, where

MICRO_STEPS = 10_000_000  # at most, per communication step
FINENESS = 0.025  # micro-step at most, in time constants of the flux: flux errors below 1e-9 where the core saturates
REFINEMENT = 256.0  # a micro-step is shortened at most so many times, enough for tenfold overvoltage


class Valve(NamedTuple):
    """Constants of a step."""

    resistance: Scalar
    voltage: Scalar
    circuit: Circuit
    mover: Mover
    micro_step: Scalar  # length of the equal micro-steps [s]
    finest: Scalar  # shortest one that the limit asks for [s]
    open_square: Scalar  # R_open R_iron0, the share of the largest gap in the rate of the flux [1/H^2]
    rate_scale: Scalar  # N^2 R_iron0 [1/H]


class Moving(NamedTuple):
    """What is integrated while the mover moves; at rest it is the flux linkage alone."""

    lam: Scalar
    h: Scalar
    v: Scalar


class Sums(NamedTuple):
    """Integrals: losses [J] and charge [A s]."""

    losses: Scalar
    charge: Scalar


class Limit(NamedTuple):
    """Of the length of a micro-step, at some flux."""

    rate: Scalar  # of the flux, in units of `rate_scale` / N^2 s^-1
    longest: Scalar  # where the rate asks for a limit [s]


def micro_step(
    valve: Valve, left: Scalar, at: Moving, mode: Scalar, sums: Sums
) -> tuple[tuple[Scalar, Moving, Scalar, Sums], Scalar]:
    """One step of the loop, or all equal ones; `left` is what is left of the communication step [s]."""
    limit, is_moving = _limit(valve, at.lam), mode == MOVING
    dt = _limited(valve, left, limit)
    length, then, mode_then, part = cond(
        is_moving, lambda: _move(valve, dt, at, is_moving), lambda: _rest(valve, dt, at, mode)
    )
    left, sums = left - length, _added(sums, part)
    is_settled = not_(is_moving) & (then.lam == at.lam) & (mode_then == mode)
    left, sums = cond(is_settled, lambda: _repeated(valve, limit, length, part, left, sums), lambda: (left, sums))
    return (left, then, mode_then, sums), not_(left > 0.0)


def _repeated(valve: Valve, limit: Limit, length: Scalar, part: Sums, left: Scalar, sums: Sums) -> tuple[Scalar, Sums]:
    """Time left and sums after the next micro-steps of equal `length`: where the flux has settled, each adds `part`."""

    def is_equal(left: Scalar) -> Scalar:
        return (left > 0.0) & (_limited(valve, left, limit) == length)

    def again(left: Scalar, sums: Sums) -> tuple[tuple[Scalar, Sums], Scalar]:
        left = left - length
        return (left, _added(sums, part)), not_(is_equal(left))

    return cond(is_equal(left), lambda: loop(MICRO_STEPS, again, (left, sums)), lambda: (left, sums))


def _added(sums: Sums, part: Sums) -> Sums:
    return Sums(sums.losses + part.losses, sums.charge + part.charge)


def _limit(valve: Valve, lam: Scalar) -> Limit:
    """Limit of a micro-step where the core saturates.

    By (51) with (50) the flux has the rate r/N^2 (R_air + R_iron^2 / R_iron0) [1/s], which grows a hundredfold in
    saturation; the explicit method would lose its accuracy there, and far in saturation its stability.  Beyond the
    limit of shortening, the constant reluctance of the core above 0.999 of saturation keeps the flux bounded.
    """
    rate = valve.resistance * (valve.open_square + square(magnetics.core_law(lam, valve.circuit)))  # times the scale
    fine = FINENESS * valve.rate_scale / rate
    return Limit(rate, where(fine < valve.finest, valve.finest, fine))


def _limited(valve: Valve, left: Scalar, limit: Limit) -> Scalar:
    """The next part of what is left of a step, or less."""
    dt = next_part(left, valve.micro_step)
    return where(limit.rate * dt > FINENESS * valve.rate_scale, least(dt, limit.longest), dt)


def _move(valve: Valve, dt: Scalar, at: Moving, is_moving: Scalar) -> tuple[Scalar, Moving, Scalar, Sums]:
    """Step of the moving mover, up to the contact if there is one."""
    mover, after = valve.mover, partial(rk4, partial(_moving_rates, valve), at)
    y, sums = after(dt)
    is_below = y.h < mover.lower

    def land() -> tuple[Scalar, Moving, Scalar, Sums]:
        def distance(length: Scalar) -> Scalar:
            return motion.clearance(after(length)[0].h, is_below, mover)

        ends = (motion.clearance(at.h, is_below, mover), motion.clearance(y.h, is_below, mover))
        length = crossing(distance, dt, *ends)
        then, sums = after(length)
        stop = where(is_below, mover.lower, mover.upper)
        mode = motion.leaving(where(is_below, CLOSED, OPEN), _net_force(valve, then.lam, stop))
        losses = sums.losses + motion.kinetic_energy(then.v, mover)
        return length, Moving(then.lam, stop, 0.0), mode, Sums(losses, sums.charge)

    # `is_moving` spares many runs at once the search for a contact in those that rest: they compute both branches
    return cond(is_moving & (is_below | (y.h > mover.upper)), land, lambda: (dt, y, MOVING, sums))


def _rest(valve: Valve, dt: Scalar, at: Moving, mode: Scalar) -> tuple[Scalar, Moving, Scalar, Sums]:
    """Step on a stop, of the flux only, up to the release if there is one."""
    gap_reluctance, slope = magnetics.gap_law(at.h, valve.circuit)
    spring = motion.spring_force(at.h, valve.mover)

    def margin(y: tuple[Scalar]) -> Scalar:
        return -motion.inward(mode, magnetics.force(y[0], slope, valve.circuit) + spring)

    rate = partial(_resting_rates, valve, gap_reluctance)
    dt, (lam,), sums, is_released = rk4_until(rate, (at.lam,), dt, margin)
    return dt, Moving(lam, at.h, 0.0), where(is_released, MOVING, mode), sums


def _moving_rates(valve: Valve, y: Moving) -> tuple[Moving, Sums]:
    """(51) and (52); integrands: losses in copper and damper [W], and the current [A]."""
    c, mover = valve.circuit, valve.mover
    gap_reluctance, slope = magnetics.gap_law(y.h, c)
    i = magnetics.current(y.lam, gap_reluctance + magnetics.core_law(y.lam, c), c)
    drop = valve.resistance * i
    drag = mover.damping * y.v
    acceleration = (magnetics.force(y.lam, slope, c) + motion.spring_force(y.h, mover) - drag) / mover.mass
    return Moving(valve.voltage - drop, y.v, acceleration), Sums(drop * i + drag * y.v, i)


def _resting_rates(valve: Valve, gap_reluctance: Scalar, y: tuple[Scalar]) -> tuple[tuple[Scalar], Sums]:
    """(51) at a fixed gap; integrands as above."""
    c = valve.circuit
    i = magnetics.current(y[0], gap_reluctance + magnetics.core_law(y[0], c), c)
    drop = valve.resistance * i
    return (valve.voltage - drop,), Sums(drop * i, i)


def _net_force(valve: Valve, lam: Scalar, h: Scalar) -> Scalar:
    """Force on the mover at rest [N], (52)."""
    _, slope = magnetics.gap_law(h, valve.circuit)
    return magnetics.force(lam, slope, valve.circuit) + motion.spring_force(h, valve.mover)
