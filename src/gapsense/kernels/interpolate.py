"""Cubic splines through the rows of a table, with a continuous second derivative, for plants and estimators alike."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.trace import load, locate, where


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
    left, right = load(knots, k), load(knots, k, 1)
    y, y_next = load(values, k), load(values, k, 1)
    c, c_next = load(curvatures, k), load(curvatures, k, 1)
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
