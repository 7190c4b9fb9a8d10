"""Reluctance of a gap, over N^2, that is corrected by a factor and a bend: a table, or a formula with fringing."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.estimators.reduced_model import SMALLEST_GAP, GapLaw
from gapsense.kernels.elementary import log, spline
from gapsense.kernels.layout import Array, Scalar, Table
from gapsense.kernels.trace import cond, square, where


class Gap(NamedTuple):
    """The law as it is believed, without factor and bend."""

    is_table: Scalar
    knots: Annotated[Array, Table()]  # [m]
    reluctance: Annotated[Array, Table()]  # [1/H]
    curvature: Annotated[Array, Table()]  # [1/(H m^2)]
    scale: Scalar  # 1/N^2
    offset: Scalar
    slope: Scalar
    fringing: Scalar
    window: Scalar
    smallest: Scalar  # between the stops [m]
    largest: Scalar
    bump: Scalar  # see `bump` [1/(H m^2)]


def make_gap(par: Any) -> Gap:
    """The law by the parameters of an estimator or a controller that have the names of those of `Mhe`."""
    scale = 1.0 / square(par.coil_turns)
    law = Gap(
        is_table=par.gap_law == GapLaw.table,
        knots=par.gap_file_gap,
        reluctance=par.gap_file_reluctance,
        curvature=par.gap_file_spline,
        scale=scale,
        offset=par.gap_reluctance * scale,
        slope=par.gap_slope * scale,
        fringing=par.gap_fringing,
        window=par.gap_window,
        smallest=par.stop_lower,
        largest=par.stop_upper,
        bump=0.0,
    )
    rise = gap_law(law.largest, law)[0] - gap_law(law.smallest, law)[0]
    return law._replace(bump=2.0 * rise / square(law.largest - law.smallest))


def gap_law(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    """Believed R_g(z) without factor and bend, its first and its second derivative [1/H]."""
    return cond(law.is_table, lambda: _tabulated(z, law), lambda: _fringing(z, law))


def _tabulated(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    R, slope, curvature = spline(z, law.knots, law.reluctance, law.curvature)
    return law.scale * R, law.scale * slope, law.scale * curvature


def _fringing(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    """R_g0 + R_g0' z / (1 + k z ln(c/z))."""
    z = where(z > SMALLEST_GAP, z, SMALLEST_GAP)
    k, ratio = law.fringing, log(law.window / z)
    w, rise = 1.0 + k * z * ratio, 1.0 + k * z
    slope = law.slope / (w * w)
    curvature = slope * k * (w - 2.0 * rise * (ratio - 1.0)) / w
    return law.offset + law.slope * z / w, slope * rise, curvature


def bump(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    """What a bend of 1 adds to R_g: in the middle half of its rise from stop to stop; and the derivatives [1/H]."""
    most = law.bump
    return most * (z - law.smallest) * (law.largest - z), most * (law.smallest + law.largest - 2.0 * z), -2.0 * most


def gap(z: Scalar, law: Gap, factor: Scalar, bend: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """R_g corrected, its first and its second derivative [1/H]."""
    R, slope, curvature = (factor * a + bend * b for a, b in zip(gap_law(z, law), bump(z, law)))
    return R, slope, curvature
