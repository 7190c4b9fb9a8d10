"""Magnetic equivalent circuit of one coil: gap laws, saturating core, current, force and energy.

The laws are defined for every flux linkage and every gap, because a trial stage of an integrator may lie beyond
saturation or slightly beyond a stop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from gapsense.kernels.elementary import Cubic, cubic, log, spline_piece
from gapsense.kernels.interface import input_, ports
from gapsense.kernels.layout import Array, Scalar, blank
from gapsense.kernels.trace import cond, fabs, load, locate, square, where

MU_0 = 4e-7 * math.pi  # [H/m]
SATURATED = 0.999  # |lambda| / lambda_sat from which the core reluctance stays constant
SMALLEST_GAP = 1e-12  # below it there is no fringing [m]


@ports()
class Inputs(NamedTuple):
    """Voltage, and the communication step that ends at `time`."""

    time: Scalar  # [s]
    dt: Scalar  # [s]
    voltage: Scalar = input_("V", "Coil voltage, held during the step", source="drive.voltage_mean", nominal=30.0)


class Circuit(NamedTuple):
    """Coil, gap and core; made once per step, outside the loops, so that its values are computed once."""

    turns: Scalar  # N [1]
    core_reluctance: Scalar  # R_iron0 [1/H]
    core_saturation: Scalar  # lambda_sat [Wb]
    unfringed: Scalar  # r0 = 1/(mu0 A), slope of the gap reluctance without fringing [1/(H m)]
    fringing: Scalar  # k = 1/sqrt(A) [1/m]
    window: Scalar  # 2 G, twice the length along which the fringing flux bulges [m]
    is_fringing: Scalar = True  # gap law with fringing
    slope: Scalar = 0.0  # k_air of the linear law, if not [1/(H m)]
    is_table: Scalar = False  # gap law from the table instead
    table_gap: Array = ()  # increasing [m]
    table_reluctance: Array = ()  # [1/H]
    table_slope: Array = ()  # [1/(H m)]


class Gap(NamedTuple):
    """What a gap of some length is to the circuit; it stays the same while the mover rests."""

    reluctance: Scalar  # [1/H]
    slope: Scalar  # its derivative by the gap [1/(H m)]


def gap_law(h: Scalar, c: Circuit) -> tuple[Scalar, Scalar]:
    """Reluctance of the gap `h` [1/H], and its derivative by the gap [1/(H m)]."""
    # the linear law comes last: over many runs at once the last branch is always computed, and the table may be empty
    return cond(
        c.is_table,
        lambda: _table(h, c),
        lambda: cond(c.is_fringing, lambda: fringing(h, c.unfringed, c.fringing, c.window)[:2], lambda: _linear(h, c)),
    )


def _linear(h: Scalar, c: Circuit) -> tuple[Scalar, Scalar]:
    """First term of (50)."""
    return c.slope * h, c.slope


def fringing(h: Scalar, r0: Scalar, k: Scalar, window: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """R = r0 h / w with w = 1 + k h ln(W/h) and W = `window`, dR/dh = r0 (1 + k h) / w^2, and d2R/dh2.

    Continued by r0 h below zero, and above W, where the logarithm changes its sign.
    """
    has_fringes = (h > SMALLEST_GAP) & (h < window)
    z = where(has_fringes, h, window)
    bulge = log(window / z)
    widening = 1.0 + k * z * bulge
    squared = widening * widening
    curvature = r0 * k * (widening - 2.0 * (1.0 + k * z) * (bulge - 1.0)) / (squared * widening)
    return r0 * h / widening, r0 * where(has_fringes, 1.0 + k * z, 1.0) / squared, where(has_fringes, curvature, 0.0)


class SmoothGap(NamedTuple):
    """Gap law with a continuous second derivative, by formula or by a cubic spline."""

    is_table: Scalar
    closed: Scalar  # R_g0, reluctance of the closed gap [1/H]
    unfringed: Scalar  # R_gp [1/(H m)]
    fringing: Scalar  # k_f [1/m]
    window: Scalar  # c_f [m]
    knots: Array  # increasing, at least two [m]
    reluctance: Array  # [1/H]
    curvature: Array  # second derivative of the spline [1/(H m^2)]


class LocalGap(NamedTuple):
    """A smooth gap law around a gap: that of a table is the polynomial between two of its rows."""

    law: SmoothGap
    piece: Cubic


def gap_near(h: Scalar, gap: SmoothGap) -> LocalGap:
    """The law around the gap `h`: found once, it serves a whole step of an integrator.

    Where a step passes a row of the table it goes on with the polynomial before: up to the second derivative there is
    no difference.  The error is of order 4 in the step, and in the actuator of [RTS] below that of a table of 29 rows.
    """
    piece = cond(gap.is_table, lambda: spline_piece(h, gap.knots, gap.reluctance, gap.curvature), lambda: blank(Cubic))
    return LocalGap(gap, piece)


def local_gap_law(h: Scalar, gap: LocalGap) -> tuple[Scalar, Scalar, Scalar]:
    """Reluctance of the gap `h` [1/H], and its first and second derivative by the gap."""
    law = gap.law

    def formula() -> tuple[Scalar, Scalar, Scalar]:
        R, slope, curvature = fringing(h, law.unfringed, law.fringing, law.window)
        return law.closed + R, slope, curvature

    return cond(law.is_table, lambda: cubic(h, gap.piece), formula)


def smooth_gap_law(h: Scalar, gap: SmoothGap) -> tuple[Scalar, Scalar, Scalar]:
    """Reluctance of the gap `h` [1/H], and its first and second derivative by the gap.

    R_g = R_g0 + R_gp h / (1 + k_f h ln(c_f/h)), our reading of [RTS] Fig. 4, or the spline of a table.
    """
    return local_gap_law(h, gap_near(h, gap))


def _table(h: Scalar, c: Circuit) -> tuple[Scalar, Scalar]:
    """Linear interpolation of both columns, and extrapolation at both ends."""
    k = locate(c.table_gap, h)
    left = load(c.table_gap, k)
    t = (h - left) / (load(c.table_gap, k, 1) - left)
    R, R_next = load(c.table_reluctance, k), load(c.table_reluctance, k, 1)
    slope, slope_next = load(c.table_slope, k), load(c.table_slope, k, 1)
    return R + t * (R_next - R), slope + t * (slope_next - slope)


def core_law(lam: Scalar, c: Circuit) -> Scalar:
    """Reluctance of the core by Froehlich and Kennelly [1/H], second term of (50).

    From 0.999 of saturation it is constant: positive, continuous, and the law never comes near its pole.
    """
    x = fabs(lam) / c.core_saturation
    return c.core_reluctance / where(x < SATURATED, 1.0 - x, 1.0 - SATURATED)


def current(lam: Scalar, R: Scalar, c: Circuit) -> Scalar:
    """Current [A] by Hopkinson's law, (49)."""
    return lam / c.turns * R / c.turns


def force(lam: Scalar, slope: Scalar, c: Circuit) -> Scalar:
    """Magnetic force along the gap [N], (53): negative, it closes the gap."""
    return flux_force(lam / c.turns, slope)


def flux_force(flux: Scalar, slope: Scalar) -> Scalar:
    """Magnetic force along the gap [N], [RTS] (12)."""
    return -0.5 * (flux * flux) * slope


def energy(lam: Scalar, gap_reluctance: Scalar, c: Circuit) -> Scalar:
    """Energy of the magnetic field [J], the integral of (49) over the flux linkage at a fixed gap."""
    x = fabs(lam) / c.core_saturation
    y = where(x < SATURATED, x, SATURATED)
    saturable = -y - log(1.0 - y) + 0.5 * (square(x) - square(y)) / (1.0 - SATURATED)
    core = square(c.core_saturation / c.turns) * c.core_reluctance * saturable
    return 0.5 * square(lam / c.turns) * gap_reluctance + core
