"""Functions of one variable: exp, log and tanh of our own, and cubic splines through the rows of a table.

Exp, log and tanh have the same bits on every machine and in every language, and are below 1 ulp wrong.  C
libraries round these functions each in their own way.  Here they are basic operations of IEEE 754 in a fixed order,
written once: run on floats they are the reference, traced they become the functions that generated code brings along.

    exp    x = n ln 2 + r, |r| <= ln(2) / 2;  exp(r) = 1 + r + r c / (2 - c), c = r - r^2 E(r^2);  times 2^n
    log    x = 2^n m, sqrt(1/2) <= m <= sqrt(2);  log(m) = 2 artanh(s), s = (m - 1) / (m + 1), by L(s^2);  plus n ln 2
    tanh   near zero x + x z P(z) / Q(z), z = x^2;  else 1 - 2 / (exp(2 x) + 1), the rounding of both sums put right

E, L, P and Q interpolate at Chebyshev nodes, computed in 60 digits.  Splines have a continuous second derivative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.trace import clip, cond, exponent, fabs, load, locate, mantissa, operation, scale, sqrt, where

INVERSE_LN2, SQRT2 = 1.4426950408889634, 1.4142135623730951


class Format(NamedTuple):
    """A format of numbers: its ranges, and coefficients for its digits, those of the lowest power first."""

    rounder: float  # what has been added to it is a whole number
    ln2: tuple[float, float]  # with so few digits that its product with n is exact, and what that lacks
    normal: tuple[float, float]  # range in which exp and its factors are normal numbers
    ends: tuple[float, float]  # beyond, exp is zero or infinite
    E: Sequence[float]
    least: float  # normal number
    lift: float  # a power of two that makes numbers below it normal
    L: Sequence[float]
    joint: float  # up to which tanh is computed as near zero
    one: float  # from which on it is 1
    P: Sequence[float]
    Q: Sequence[float]


DOUBLE = Format(
    rounder=1.5 * 2.0**52,
    ln2=(0.6931471803691238, 1.9082149292705877e-10),
    normal=(-708.0, 709.0),
    ends=(-746.0, 710.0),
    E=(0.1666666666666666, -0.002777777777755961, 6.61375646923689e-05, -1.6534056337473796e-06, 4.143590972317425e-08),
    least=2.0**-1022,
    lift=54.0,
    L=(
        *(0.666666666666667, 0.39999999999899505, 0.28571428625975487, 0.2222221113479508, 0.18182889125261723),
        *(0.15331721600556042, 0.14616449685043406),
    ),
    joint=0.7,
    one=22.0,
    P=(-0.3333333333333333, -0.021418076590167603, -0.00024369180078454486, -1.741900968920597e-08),
    Q=(1.0, 0.4642542297705028, 0.024528005405793342, 0.00025474949353425846),
)
FLOAT = Format(
    rounder=1.5 * 2.0**23,
    ln2=(0.693145751953125, 1.4286068e-06),
    normal=(-87.0, 88.0),
    ends=(-105.0, 89.0),
    E=(0.16666667, -0.0027777643, 6.583897e-05),
    least=2.0**-126,
    lift=25.0,
    L=(0.6666667, 0.40000123, 0.28550822, 0.23330468),
    joint=0.7,
    one=9.1,
    P=(-0.33333334, -0.014759284),
    Q=(1.0, 0.44427785, 0.015806481),
)


def _polynomial(coefficients: Sequence[Any], z: Any) -> Any:
    """In pairs, so that a processor can do several at a time."""
    if len(coefficients) == 1:
        return coefficients[0]
    pairs = [a + z * b for a, b in zip(coefficients[::2], coefficients[1::2])]
    return _polynomial([*pairs, *coefficients[2 * len(pairs) :]], z * z)


def _parts(x: Any, form: Format) -> tuple[Any, Any]:
    """Whole `n` and small `d` of exp(x) = 2^n (1 + d)."""
    n = (x * INVERSE_LN2 + form.rounder) - form.rounder
    high, low = x - n * form.ln2[0], n * form.ln2[1]
    r = high - low
    z = r * r
    c = r - z * _polynomial(form.E, z)
    return n, high - (low - r * c / (2.0 - c))


def _exp(x: Any, form: Format) -> Any:
    is_normal = (x > form.normal[0]) & (x < form.normal[1])
    within = cond(is_normal, lambda: x, lambda: clip(where(x == x, x, 0.0), *form.ends))
    n, d = _parts(within, form)
    return cond(is_normal, lambda: scale(1.0 + d, n), lambda: _beyond(x, n, 1.0 + d))


def _beyond(x: Any, n: Any, y: Any) -> Any:
    """Exp that may be too large, or so small that it has fewer digits: rounded once, by the second of two factors."""
    half = where(x < 0.0, n + 100.0, n - 1.0)
    return cond(fabs(x) < math.inf, lambda: scale(scale(y, half), n - half), lambda: where(x < 0.0, 0.0, x))


def _log(x: Any, form: Format) -> Any:
    return cond((x > 0.0) & (x < math.inf), lambda: _log_of_positive(x, form), lambda: _no_log(x))


def _log_of_positive(x: Any, form: Format) -> Any:
    normal, lifted = cond(x < form.least, lambda: (scale(x, form.lift), form.lift), lambda: (x, 0.0))
    from_one = mantissa(normal)
    is_large = from_one > SQRT2
    m, n = where(is_large, 0.5 * from_one, from_one), exponent(normal) + where(is_large, 1.0, 0.0) - lifted
    f = m - 1.0
    half, s = 0.5 * f * f, f / (2.0 + f)
    z = s * s
    rest = z * _polynomial(form.L, z)
    return n * form.ln2[0] - ((half - (s * (half + rest) + n * form.ln2[1])) - f)


def _no_log(x: Any) -> Any:
    """Of zero minus infinity, of negative numbers none, else the same; the former two are errors in Python."""
    return cond(x == 0.0, lambda: -1.0 / (x * x), lambda: sqrt(x))


def _tanh(x: Any, form: Format) -> Any:
    a = fabs(x)
    return cond(a < form.joint, lambda: _tanh_near_zero(x, form), lambda: _tanh_beyond(x, a, form))


def _tanh_near_zero(x: Any, form: Format) -> Any:
    z = x * x
    return where(z == 0.0, x, x + x * (z * _polynomial(form.P, z) / _polynomial(form.Q, z)))


def _tanh_beyond(x: Any, a: Any, form: Format) -> Any:
    size = cond(a < form.one, lambda: _tanh_of_size(a, form), lambda: where(a == a, 1.0, a))
    return where(x < 0.0, -size, size)


def _tanh_of_size(a: Any, form: Format) -> Any:
    n, d = _parts(a + a, form)
    power = scale(1.0, n)
    whole, part = power + 1.0, power * d
    total = whole + part
    q = 2.0 / total
    y = 1.0 - q
    return y + (((1.0 - y) - q) + 0.5 * q * q * (part - (total - whole)))


def _in_double(name: str, x: float) -> Any:
    return FORMULAS[name](x, DOUBLE)


FORMULAS: dict[str, Callable[[Any, Format], Any]] = {"exp": _exp, "log": _log, "tanh": _tanh}
exp, log, tanh = (operation(name, partial(_in_double, name)) for name in FORMULAS)


class Cubic(NamedTuple):
    """A polynomial of degree 3 around a place."""

    place: Scalar
    value: Scalar
    slope: Scalar
    curvature: Scalar  # second derivative there
    change: Scalar  # third derivative


def spline_piece(x: Scalar, knots: Array, values: Array, curvatures: Array) -> Cubic:
    """The piece of a spline that holds at `x`; beyond its ends the second derivative stays.

    Parameters
    ----------
    x : scalar
        Where.
    knots, values, curvatures : tables
        Increasing places, at least two; the values and the second derivatives of the spline there.
    """
    k = locate(knots, x)
    ends = [load(column, k, shift) for column in (knots, values, curvatures) for shift in (0, 1)]
    return piece(x, *ends)


def piece(x: Scalar, left: Scalar, right: Scalar, y: Scalar, y_next: Scalar, c: Scalar, c_next: Scalar) -> Cubic:
    """The piece between two places, from the values and second derivatives there."""
    width = right - left
    mean, sixth = (y_next - y) / width, width / 6.0
    is_above = x > right
    return Cubic(
        place=where(is_above, right, left),
        value=where(is_above, y_next, y),
        slope=where(is_above, mean + sixth * (c + 2.0 * c_next), mean - sixth * (2.0 * c + c_next)),
        curvature=where(is_above, c_next, c),
        change=where((x < left) | is_above, 0.0, (c_next - c) / width),
    )


def cubic(x: Scalar, at: Cubic) -> tuple[Scalar, Scalar, Scalar]:
    """Value, first and second derivative."""
    t = x - at.place
    half = 0.5 * t
    curvature = at.curvature + at.change * t
    slope = at.slope + half * (at.curvature + curvature)
    return at.value + t * (at.slope + half * (at.curvature + at.change * (t / 3.0))), slope, curvature


def spline(x: Scalar, knots: Array, values: Array, curvatures: Array) -> tuple[Scalar, Scalar, Scalar]:
    """Value, first and second derivative of a spline; the parameters are those of `spline_piece`."""
    return cubic(x, spline_piece(x, knots, values, curvatures))
