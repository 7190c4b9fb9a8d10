"""A surface z(x, y): a tensor spline on a grid, held by its integral over y: a potential, whose two derivatives fit."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.kernels.elementary import Cubic, cubic, piece
from gapsense.kernels.integrate import least
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.trace import clip, floor, load, locate, where


class Surface(NamedTuple):
    """Table of a tensor spline z(x, y), odd in y, as `fmi.tables` makes it of a grid; x is the same in each block."""

    places: Array  # of x, not decreasing
    axis: Array  # places of y, and then the last of them
    values: Array  # z
    bends: Array  # its second derivative by y
    integrals: Array  # its integral over y from 0
    curves: Array  # second derivatives of the three by x
    bend_curves: Array
    integral_curves: Array


class Patch(NamedTuple):
    """A surface around a place: the coefficients of a polynomial in y, each a polynomial in x."""

    place: Scalar  # in y
    integral: Cubic
    value: Cubic
    slope: Cubic
    curvature: Cubic
    change: Cubic


class Level(NamedTuple):
    """A surface at a place."""

    integral: Scalar  # of z over y
    tilt: Scalar  # its derivative by x
    value: Scalar  # z
    slope: Scalar  # its derivative by y


def surface_patch(x: Scalar, y: Scalar, of: Surface) -> Patch:
    """The patch that holds at `x` and at `y`, which is not negative; beyond the grid straight on in y."""
    last = locate(of.axis, 1e300) + 1.0
    width = least(locate(of.axis, load(of.axis, last)) + 2.0, last - 1.0)  # of a block
    block = clip(floor(locate(of.places, x) / width), 0.0, floor((last + 1.0) / width) - 2.0)
    column = least(locate(of.axis, y), width - 2.0)
    node = clip(block * width + column, 0.0, last - 1.0 - width)  # a damaged table is no reason to look beyond its end
    low, high = load(of.axis, column), load(of.axis, column, 1)

    def in_y(at: Scalar, values: Array, bends: Array, integrals: Array) -> tuple[Scalar, ...]:
        ends = [load(column, at, shift) for column in (values, bends) for shift in (0, 1)]
        at_y, is_above = piece(y, low, high, *ends), y > high
        integral = where(is_above, load(integrals, at, 1), load(integrals, at))
        return integral, at_y.value, at_y.slope, where(is_above, 0.0, at_y.curvature), at_y.change

    rows = (node, node + width)
    values = [in_y(at, of.values, of.bends, of.integrals) for at in rows]
    curves = [in_y(at, of.curves, of.bend_curves, of.integral_curves) for at in rows]
    left, right = (load(of.places, at) for at in rows)
    return Patch(where(y > high, high, low), *(piece(x, left, right, *ends) for ends in zip(*values, *curves)))


def surface(x: Scalar, y: Scalar, patch: Patch) -> Level:
    """The surface at a place, by the polynomial of `patch`."""
    s = y - patch.place
    (W, W_x, _), (z, z_x, _), (d, d_x, _), (c, c_x, _), (q, q_x, _) = (cubic(x, part) for part in patch[1:])
    half, third, quarter = 0.5 * s, s / 3.0, 0.25 * s
    return Level(
        integral=W + s * (z + half * (d + third * (c + quarter * q))),
        tilt=W_x + s * (z_x + half * (d_x + third * (c_x + quarter * q_x))),
        value=z + s * (d + half * (c + third * q)),
        slope=d + s * (c + half * q),
    )
