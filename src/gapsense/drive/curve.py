"""A voltage given by a table, a part of which may repeat."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.trace import clip, cond, floor, load, locate, where


class Curve(NamedTuple):
    """Table of the voltage, and the part of it that repeats."""

    time: Array
    voltage: Array
    integral: Array
    period: Scalar
    repeat_from: Scalar


def tabulated(time: Scalar, dt: Scalar, tolerance: Scalar, curve: Curve) -> tuple[Scalar, Scalar]:
    """Value at the end and mean of a table; `n` and `m` periods before end and start lie in its repeated part."""
    period, tol = positive(curve.period), tolerance / positive(curve.period)
    start = time - dt
    n = _repeats(-floor(tol - (time - curve.repeat_from) / period) - 1.0, curve)  # the left limit at the end
    m = _repeats(floor((start - curve.repeat_from) / period + tol), curve)  # the right limit at the start
    end, start = time - n * period, start - m * period
    k = locate(curve.time, end - tolerance)  # the piece before a jump at the end
    t0, t1 = load(curve.time, k), load(curve.time, k, 1)
    u0, u1 = load(curve.voltage, k), load(curve.voltage, k, 1)
    is_before, is_after = end <= t0 + tolerance, start >= t1 - tolerance  # then `k` is the first or the last piece
    is_inside = (start >= t0 - tolerance) & (end <= t1 + tolerance)
    u_end = where(is_before, u0, _value(curve, k, end))
    u_start = where(is_after, u1, _value(curve, k, start))

    def over_pieces() -> Scalar:
        repeated = _integral(curve, curve.repeat_from + period, 0.0) - _integral(curve, curve.repeat_from, 0.0)
        here = _integral(curve, end, tolerance) - _integral(curve, start, tolerance)
        return (here + (n - m) * repeated) / positive(dt)

    mean = cond(
        (n == m) & (is_inside | is_before | is_after),
        lambda: (u_start + u_end) / 2.0,  # one piece: a constant voltage comes out exactly
        over_pieces,
    )
    return u_end, where(dt > 0.0, mean, u_end)


def _repeats(count: Scalar, curve: Curve) -> Scalar:
    return where((curve.period > 0.0) & (count > 0.0), count, 0.0)


def _value(curve: Curve, k: Scalar, t: Scalar) -> Scalar:
    """Voltage at time `t` from piece `k` of the table, its ends held."""
    t0, t1 = load(curve.time, k), load(curve.time, k, 1)
    u0, u1 = load(curve.voltage, k), load(curve.voltage, k, 1)
    w = (t - t0) / positive(t1 - t0)
    return where(t < t0, u0, where(t >= t1, u1, u0 + (u1 - u0) * w))


def _integral(curve: Curve, t: Scalar, tolerance: Scalar) -> Scalar:
    """Integral of the voltage from the first row to time `t`."""
    k = locate(curve.time, t - tolerance)
    t0, t1 = load(curve.time, k), load(curve.time, k, 1)
    inside = clip(t, t0, t1)
    u0, u = load(curve.voltage, k), _value(curve, k, t)
    return load(curve.integral, k) + (inside - t0) * (u0 + u) / 2.0 + (t - inside) * u


def positive(x: Scalar) -> Scalar:
    """`x`, or 1 in place of what cannot be divided by."""
    return where(x > 0.0, x, 1.0)
