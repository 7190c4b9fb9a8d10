"""Flux linkage for a soft operation: the mover goes from rest along a polynomial and meets its stop slowly.

The path of an operation ends at a distance d of the stop with the approach speed v, and goes on with that speed.  A
mover that is to arrive needs more pull than the path says: the flux linkage is biased at its end, and more and more
where the mover is late.  A mover that the voltage has left beside the path returns to it until its travel ends.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.control.mover import Mover, balance, squared_flux
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, cond, sqrt, where

BENT = 1.4  # slope at the start of the lead, over its mean
BIAS, FROM = 0.025, 0.8  # of the square of the flux linkage, from this share of the travel on
PULL, PULLED = 0.4, 3.0  # of it per millisecond that the mover is late; no longer than that
MILLISECOND = 1e-3
SLOWEST = 0.05  # approach speed by which an arrival is expected at the latest [m/s]
LEAST = 1e-6  # square of a flux linkage [Wb^2]


class Deviation(NamedTuple):
    """Where the mover was beside the path, a time after its take-off."""

    since: Scalar = 0.0  # 0: nowhere [s]
    position: Scalar = 0.0
    velocity: Scalar = 0.0
    acceleration: Scalar = 0.0


class Operation(NamedTuple):
    """An operation that is planned; its time begins with the command."""

    is_closing: Scalar
    lead: Scalar  # until the mover is to leave its stop [s]
    travel: Scalar  # T, then until it is near the other stop [s]
    tail: Scalar  # time of the approach [s]
    distance: Scalar  # d [m]
    speed: Scalar  # v [m/s]
    start: Scalar  # flux linkage at its start [Wb]
    deviation: Deviation = Deviation()


class Place(NamedTuple):
    """A point of the path."""

    position: Scalar
    velocity: Scalar
    acceleration: Scalar


def stops(is_closing: Scalar, m: Mover) -> tuple[Scalar, Scalar]:
    """The stop where an operation begins, and the one where it is to end."""
    low, high = m.gap.smallest, m.gap.largest
    return where(is_closing, high, low), where(is_closing, low, high)


def path(tau: Scalar, plan: Operation, m: Mover) -> Place:
    """The path, a time after the mover has left its stop."""
    z0, _ = stops(plan.is_closing, m)
    stroke = m.gap.largest - m.gap.smallest
    length, T, v, sign = stroke - plan.distance, plan.travel, plan.speed, where(plan.is_closing, -1.0, 1.0)
    x = clip(tau / T, 0.0, 1.0)
    rest, beyond = 1.0 - x, where(tau > T, tau - T, 0.0)
    y = length * (x * x * x * (10.0 - x * (15.0 - 6.0 * x))) + v * (
        T * (x * x * x * (-4.0 + x * (7.0 - 3.0 * x))) + beyond
    )
    speed = length / T * (30.0 * x * x * rest * rest) + v * (x * x * (-12.0 + x * (28.0 - 15.0 * x)))
    change = length / (T * T) * (60.0 * x * rest * (1.0 - 2.0 * x)) + v / T * (x * (-24.0 + x * (84.0 - 60.0 * x)))
    is_bent = (tau >= 0.0) & (tau <= T)
    y = where(y < stroke, y, stroke)
    return Place(z0 + sign * y, where(tau < 0.0, 0.0, sign * speed), where(is_bent, sign * change, 0.0))


def arrival(plan: Operation) -> Scalar:
    """Time after take-off at which the mover is to land [s]."""
    return plan.travel + plan.distance / where(plan.speed > SLOWEST, plan.speed, SLOWEST)


def is_planned(time: Scalar, plan: Operation) -> Scalar:
    """Whether the profile says something a time after the command."""
    return time <= plan.lead + plan.travel + plan.tail


def flux(time: Scalar, plan: Operation, m: Mover) -> Scalar:
    """The flux linkage a time after the command [Wb]."""
    tau = time - plan.lead
    return cond(tau < 0.0, lambda: _leading(time, plan, m), lambda: _moving(tau, plan, m))


def _leading(time: Scalar, plan: Operation, m: Mover) -> Scalar:
    """From the start to the balance of the spring."""
    z0, _ = stops(plan.is_closing, m)
    w = time / plan.lead
    return plan.start + (sqrt(balance(z0, m)) - plan.start) * w * (BENT - (BENT - 1.0) * w)


def _moving(tau: Scalar, plan: Operation, m: Mover) -> Scalar:
    on = path(tau, plan, m)
    at = cond(plan.deviation.since > 0.0, lambda: _beside(on, tau, plan), lambda: on)
    late = clip((tau - arrival(plan)) / MILLISECOND, 0.0, PULLED)
    sign = where(plan.is_closing, 1.0, -1.0)
    bias = where(tau > FROM * plan.travel, BIAS, 0.0)
    squared = squared_flux(*at, m) * (1.0 + sign * PULL * late) * (1.0 + sign * bias)
    return sqrt(where(squared > LEAST, squared, LEAST))


def _beside(on: Place, tau: Scalar, plan: Operation) -> Place:
    """The place beside one on the path: a deviation ends with the travel, smoothly."""
    since, y, v, a = plan.deviation
    T = plan.travel - since
    x = clip((tau - since) / T, 0.0, 1.0)
    rest, by_v, by_a = 1.0 - x, v * T, 0.5 * a * T * T
    place = y * (1.0 - x * x * x * (10.0 - x * (15.0 - 6.0 * x)))
    place = place + by_v * (x * (1.0 - x * x * (6.0 - x * (8.0 - 3.0 * x)))) + by_a * (x * x * rest * rest * rest)
    speed = by_v * (1.0 - x * x * (18.0 - x * (32.0 - 15.0 * x))) - y * (30.0 * x * x * rest * rest)
    speed = speed + by_a * (x * (2.0 - x * (9.0 - x * (12.0 - 5.0 * x))))
    change = by_a * (2.0 - x * (18.0 - x * (36.0 - 20.0 * x))) - by_v * (x * (36.0 - x * (96.0 - 60.0 * x)))
    change = where(x < 1.0, change - y * (60.0 * x * rest * (1.0 - 2.0 * x)), 0.0)
    return Place(on.position + place, on.velocity + speed / T, on.acceleration + change / (T * T))
