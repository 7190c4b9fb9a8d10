"""Voltages of two levels: where a step lies among the edges of a pulse that repeats."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.drive.curve import positive
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import fabs, floor, where

ALWAYS = -1e30  # phase at which a wave without a beginning begins


class Pulse(NamedTuple):
    """High for `duty` of each period from `delay` on; low before phase `first`."""

    period: Scalar
    duty: Scalar
    delay: Scalar
    first: Scalar


class Wave(NamedTuple):
    """Two levels [V], and when the voltage is at the upper one."""

    low: Scalar
    high: Scalar
    pulse: Pulse


def levels(low: Scalar, high: Scalar, is_high: Scalar, fraction: Scalar) -> tuple[Scalar, Scalar]:
    """Voltage at the end and mean; in this form 0 and 1 give the levels exactly."""
    return where(is_high, high, low), low * (1.0 - fraction) + high * fraction


def pulsed(time: Scalar, dt: Scalar, tolerance: Scalar, pulse: Pulse) -> tuple[Scalar, Scalar]:
    """Whether it is high at the end, and the fraction of the step in which it is.

    Phases count from the start of the period in which the step ends, so that their difference is exact to rounding of
    the step, not of the time.  The mean follows from the phase that is high, I(p) = floor(p) D + min(p - floor(p), D).
    """
    D, tol = pulse.duty, tolerance / pulse.period
    p = (time - pulse.delay) / pulse.period
    n = -floor(tol - p) - 1.0  # periods before this one: the end lies in (0, 1], as its left limit is wanted
    end = _on_edge(p - n, D, tol)
    start = p - n - dt / pulse.period
    m = floor(start + tol)
    phase = start - m
    phase = where(phase <= tol, 0.0, _on_edge(phase, D, tol))
    start = m + phase

    is_begun = n > pulse.first - 0.5
    is_high = is_begun & (end <= D) & (D > 0.0)
    first = pulse.first - n
    I_end = where(end < D, end, D)
    I_start = where(start < first, first * D, m * D + where(phase < D, phase, D))
    is_long = end > start  # else there is no step, or all of it is on an edge
    fraction = where(is_begun, I_end - I_start, 0.0) / positive(end - start)
    return is_high, where(is_long, fraction, where(is_high, 1.0, 0.0))


def _on_edge(phase: Scalar, D: Scalar, tol: Scalar) -> Scalar:
    """Phase, moved onto the edge at D or the one at 1 if that is closer than `tol`."""
    return where(fabs(phase - D) <= tol, D, where(phase >= 1.0 - tol, 1.0, phase))
