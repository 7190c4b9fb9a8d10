"""Integration of small systems of scalars, and the place inside a step where something happens.

Both work on traced scalars as on floats.  A quadrature (an energy, a charge) is integrated with the stages of the
states but is never fed back into them, so it costs no more than its integrand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, TypeAlias

from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, cond, floor, loop, where

Scalars: TypeAlias = Sequence[Any]
Rate: TypeAlias = Callable[[Any], tuple[Any, ...]]  # y -> dy/dt, integrands, and what is watched, if anything
Margin: TypeAlias = Callable[..., Scalar]  # y, and what is watched, -> what an event makes negative

TRIALS = 60  # about 10 are needed
CLOSENESS = 1e-10  # width of the final bracket, relative to the first


def equal_parts(dt: Scalar, longest: Scalar) -> Scalar:
    """Length of the equal parts of `dt` of which none is longer than `longest`; 0 for a step of no length."""
    count = -floor(1e-6 - dt / longest)  # rounded up, save for rounding errors of the quotient
    return dt / where(count > 1.0, count, 1.0)


def next_part(left: Scalar, part: Scalar) -> Scalar:
    """Length of the next part where `left` is left of the step; rounding errors do not make one part more."""
    return where(left < 1.000001 * part, left, part)


def least(a: Scalar, b: Scalar) -> Scalar:
    """The smaller one."""
    return where(a < b, a, b)


def add_integrals(sums: Any, more: Any) -> Any:
    """A record of integrals with others, of a further step."""
    return _as(sums, (a + b for a, b in zip(sums, more)))


def rk4(rate: Rate, y: Scalars, dt: Scalar, first: tuple[Any, ...] | None = None) -> tuple[Any, ...]:
    """States after `dt`, and the integrals of the integrands over `dt`; classical Runge-Kutta method of order 4.

    Parameters
    ----------
    rate : callable
        What more it returns than rates and integrands is returned as of the last stage, which lies at the end of the
        step with an error of order 3: good enough to see a switch coming, at no cost.
    y : sequence of scalars
        States at the start; a record stays one, and so do the integrands.
    dt : scalar
        Step.
    first : tuple, optional
        `rate(y)`, where it is known.

    Notes
    -----
    Explicit: stable up to about 2.7 time constants per step, accurate to 1e-9 below about a twentieth of one.
    """
    half = 0.5 * dt
    k1, q1, *_ = rate(y) if first is None else first
    k2, q2, *_ = rate(_along(y, k1, half))
    k3, q3, *_ = rate(_along(y, k2, half))
    k4, q4, *watched = rate(_along(y, k3, dt))
    sixth = dt / 6.0
    integrals = _as(q1, (_weigh(*stages) * sixth for stages in zip(q1, q2, q3, q4)))
    return _along(y, [_weigh(*stages) for stages in zip(k1, k2, k3, k4)], sixth), integrals, *watched


def rk4_until(
    rate: Rate, y: Scalars, dt: Scalar, margin: Margin, is_live: Scalar = True, first: tuple[Any, ...] | None = None
) -> tuple[Scalar, Any, Any, Scalar]:
    """Length of the step, states after it, integrals over it, and whether it ends where `margin(y)` becomes negative.

    Parameters
    ----------
    rate, y, dt
        As for `rk4`.
    margin : callable
        Of the states, and of what more `rate` returns; continuous in them, and negative once the step must end.  The
        states returned lie just beyond its zero.
    is_live : scalar
        Whether to look for the end at all: many runs at once compute branches that they do not take.
    first : tuple, optional
        `rate(y)`, where it is known.

    Notes
    -----
    A margin that is negative at the start gives a step of no length; one that becomes negative and positive again
    inside the step is not seen.
    """
    after = partial(rk4, rate, y, first=first)
    y_next, sums, *watched = after(dt)

    def shorter() -> tuple[Scalar, Any, Any, Scalar]:
        def margin_after(length: Scalar) -> Scalar:
            end, _, *watched = after(length)
            return margin(end, *watched)

        at_start = margin(y) if first is None else margin(y, *first[2:])
        length = crossing(margin_after, dt, at_start, margin(y_next, *watched))
        end, sums, *_ = after(length)
        return length, end, sums, True

    return cond(is_live & (margin(y_next, *watched) < 0.0), shorter, lambda: (dt, y_next, sums, False))


def _along(y: Scalars, k: Scalars, dt: Scalar) -> Any:
    return _as(y, (a + dt * b for a, b in zip(y, k)))


def _as(like: Scalars, values: Iterable[Scalar]) -> Any:
    """The values as a record of the same class, if it is one."""
    return like._make(values) if hasattr(like, "_make") else tuple(values)


def _weigh(k1: Scalar, k2: Scalar, k3: Scalar, k4: Scalar) -> Scalar:
    return k1 + 2.0 * (k2 + k3) + k4


def crossing(value: Callable[[Scalar], Scalar], end: Scalar, at_start: Scalar, at_end: Scalar) -> Scalar:
    """First known length in (0, `end`] at which `value` is negative; 0 if it is negative at the start.

    Parameters
    ----------
    value : callable
        Continuous function of the length, for instance a distance after a step of that length.
    end : float
        Length at which it is negative.
    at_start, at_end : float
        Its values at 0 and at `end`.

    Notes
    -----
    Regula falsi with the Illinois rule.  Trials keep half the final width away from the ends of the bracket, so that an
    end which is the zero itself closes it at once.  The end beyond the crossing is returned: a step of that length has
    certainly crossed.  A value that is flatter than a parabola at its zero is found late or not at all (`end`).
    """
    width = CLOSENESS * end

    def shrink(
        low: Scalar, at_low: Scalar, high: Scalar, at_high: Scalar, side: Scalar
    ) -> tuple[tuple[Scalar, ...], Scalar]:
        """The bracket and the values at its ends after one trial, and whether it is narrow enough."""
        slope = at_low - at_high
        secant = high + at_high * (high - low) / where(slope > 0.0, slope, 1.0)
        lowest = low + 0.5 * width
        lowest = where(lowest > low, lowest, 0.5 * (low + high))  # single precision loses half the width
        trial = clip(secant, lowest, high - 0.5 * width)
        found = value(trial)
        is_beyond = found < 0.0
        # Illinois: an end that stays for the second time counts half, or it would stay for ever
        kept_low = where(side > 0.0, 0.5 * at_low, at_low)
        kept_high = where(side < 0.0, 0.5 * at_high, at_high)
        new_low, new_high = where(is_beyond, low, trial), where(is_beyond, trial, high)
        new_at_low, new_at_high = where(is_beyond, kept_low, found), where(is_beyond, found, kept_high)
        new_side = where(is_beyond, 1.0, -1.0)
        return (new_low, new_at_low, new_high, new_at_high, new_side), new_high - new_low <= width

    _, _, high, _, _ = loop(TRIALS, shrink, (0.0, at_start, end, at_end, 0.0))
    return where(at_start < 0.0, 0.0, high)
