"""One micro-step of the solenoid valve: flux and motion, up to the next contact or release."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from gapsense.actuators import magnetics, motion
from gapsense.actuators.magnetics import Circuit, Gap
from gapsense.actuators.motion import MOVING, Contact, Mover
from gapsense.kernels.integrate import crossing, least, next_part, rk4, rk4_until
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import cond, loop, not_, square, where

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


class Step(NamedTuple):
    """Length of a micro-step, what is at its end, and what it adds to the sums."""

    length: Scalar
    at: Moving
    contact: Contact
    part: Sums


class Limit(NamedTuple):
    """Of the length of a micro-step, at some flux."""

    rate: Scalar  # of the flux, in units of `rate_scale` / N^2 s^-1
    longest: Scalar  # where the rate asks for a limit [s]


class Rest(NamedTuple):
    """What is left of the communication step."""

    time: Scalar  # [s]
    steps: Scalar  # how many micro-steps it may still take


def micro_step(
    valve: Valve, left: Rest, at: Moving, gap: Gap, contact: Contact, sums: Sums
) -> tuple[tuple[Rest, Moving, Gap, Contact, Sums], Scalar]:
    """One step of the loop, or all equal ones."""
    limit, is_moving = _limit(valve, at.lam), contact.mode == MOVING
    dt = _limited(valve, left.time, limit)

    def move() -> tuple[Step, Gap]:
        done = _move(valve, gap, dt, at, contact, is_moving)
        return done, gap_at(valve, done.at.h)

    done, gap = cond(is_moving, move, lambda: (_rest(valve, gap, dt, at, contact), gap))
    left, sums = _less(left, done), _added(sums, done.part)
    is_settled = not_(is_moving) & (done.at.lam == at.lam) & (done.contact.mode == contact.mode)
    left, sums = cond(is_settled, lambda: _repeated(valve, limit, done, left, sums), lambda: (left, sums))
    return (left, done.at, gap, done.contact, sums), not_(_goes_on(left))


def _repeated(valve: Valve, limit: Limit, done: Step, left: Rest, sums: Sums) -> tuple[Rest, Sums]:
    """Time left and sums after the next micro-steps of equal length: where the flux has settled, each does the same."""

    def is_equal(left: Rest) -> Scalar:
        return _goes_on(left) & (_limited(valve, left.time, limit) == done.length)

    def again(left: Rest, sums: Sums) -> tuple[tuple[Rest, Sums], Scalar]:
        left = _less(left, done)
        return (left, _added(sums, done.part)), not_(is_equal(left))

    return cond(is_equal(left), lambda: loop(MICRO_STEPS, again, (left, sums)), lambda: (left, sums))


def _less(left: Rest, done: Step) -> Rest:
    return Rest(left.time - done.length, left.steps - 1.0)


def _goes_on(left: Rest) -> Scalar:
    return (left.time > 0.0) & (left.steps > 0.0)


def _added(sums: Sums, part: Sums) -> Sums:
    return Sums(sums.losses + part.losses, sums.charge + part.charge)


def gap_at(valve: Valve, h: Scalar) -> Gap:
    """The gap of length `h`."""
    return Gap(*magnetics.gap_law(h, valve.circuit))


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


def _move(valve: Valve, gap: Gap, dt: Scalar, at: Moving, contact: Contact, is_moving: Scalar) -> Step:
    """Step of the moving mover, up to the contact if there is one."""
    mover, first = valve.mover, _rates_in(gap, valve, at)
    after = partial(rk4, partial(_moving_rates, valve), at, first=first)
    y, sums = after(dt)
    is_below = y.h < mover.lower

    def land() -> Step:
        def distance(length: Scalar) -> Scalar:
            return motion.clearance(after(length)[0].h, is_below, mover)

        ends = (motion.clearance(at.h, is_below, mover), motion.clearance(y.h, is_below, mover))
        length = crossing(distance, dt, *ends)
        then, sums = after(length)
        stop = where(is_below, mover.lower, mover.upper)
        now = motion.landed(then.v, is_below, _net_force(valve, then.lam, stop), contact, mover)
        losses = sums.losses + motion.impact_loss(then.v, mover)
        return Step(
            length, Moving(then.lam, stop, motion.rebound(then.v, mover.restitution)), now, Sums(losses, sums.charge)
        )

    # `is_moving` spares many runs at once the search for a contact in those that rest: they compute both branches
    return cond(is_moving & (is_below | (y.h > mover.upper)), land, lambda: Step(dt, y, contact, sums))


def _rest(valve: Valve, gap: Gap, dt: Scalar, at: Moving, contact: Contact) -> Step:
    """Step on a stop, of the flux only, up to the release if there is one."""
    spring = motion.spring_force(at.h, valve.mover)

    def margin(y: tuple[Scalar]) -> Scalar:
        return -motion.inward(contact.mode, magnetics.force(y[0], gap.slope, valve.circuit) + spring)

    rate = partial(_resting_rates, valve, gap.reluctance)
    dt, (lam,), sums, is_released = rk4_until(rate, (at.lam,), dt, margin)
    return Step(dt, Moving(lam, at.h, 0.0), motion.released(is_released, contact), sums)


def _moving_rates(valve: Valve, y: Moving) -> tuple[Moving, Sums]:
    return _rates_in(gap_at(valve, y.h), valve, y)


def _rates_in(gap: Gap, valve: Valve, y: Moving) -> tuple[Moving, Sums]:
    """(51) and (52); integrands: losses in copper and damper [W], and the current [A]."""
    c, mover = valve.circuit, valve.mover
    i = magnetics.current(y.lam, gap.reluctance + magnetics.core_law(y.lam, c), c)
    drop = valve.resistance * i
    drag = mover.damping * y.v
    acceleration = (magnetics.force(y.lam, gap.slope, c) + motion.spring_force(y.h, mover) - drag) / mover.mass
    return Moving(valve.voltage - drop, y.v, acceleration), Sums(drop * i + drag * y.v, i)


def _resting_rates(valve: Valve, gap_reluctance: Scalar, y: tuple[Scalar]) -> tuple[tuple[Scalar], Sums]:
    """(51) at a fixed gap; integrands as above."""
    c = valve.circuit
    i = magnetics.current(y[0], gap_reluctance + magnetics.core_law(y[0], c), c)
    drop = valve.resistance * i
    return (valve.voltage - drop,), Sums(drop * i, i)


def _net_force(valve: Valve, lam: Scalar, h: Scalar) -> Scalar:
    """Force on the mover at rest [N], (52)."""
    return magnetics.force(lam, gap_at(valve, h).slope, valve.circuit) + motion.spring_force(h, valve.mover)
