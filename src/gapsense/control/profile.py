"""Flux linkage for a soft operation: the mover goes from rest along a polynomial and meets its stop slowly.

The path of an operation ends at a distance d of the stop with the approach speed v, and goes on with that speed.  A
mover that is to arrive needs more pull than the path says: the flux linkage is biased at its end, and more and more
where the mover is late.
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


class Operation(NamedTuple):
    """An operation that is planned; its time begins with the command."""

    is_closing: Scalar
    lead: Scalar  # until the mover is to leave its stop [s]
    travel: Scalar  # T, then until it is near the other stop [s]
    tail: Scalar  # time of the approach [s]
    distance: Scalar  # d [m]
    speed: Scalar  # v [m/s]
    start: Scalar  # flux linkage at its start [Wb]


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
    at = path(tau, plan, m)
    late = clip((tau - arrival(plan)) / MILLISECOND, 0.0, PULLED)
    sign = where(plan.is_closing, 1.0, -1.0)
    bias = where(tau > FROM * plan.travel, BIAS, 0.0)
    squared = squared_flux(*at, m) * (1.0 + sign * PULL * late) * (1.0 + sign * bias)
    return sqrt(where(squared > LEAST, squared, LEAST))
