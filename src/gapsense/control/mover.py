"""What a controller believes of spring, mover and magnet, and the motion that follows from a flux linkage.

    m e^-q dv/dt = F(z) (1 - lambda^2 / B(z)) - c e^(r-q) v,    F = k (z_sp - z),    B = 2 F / R_g'(z) exp(a + b x),

where x is 0 at the upper stop and 1 at the lower one, and B the square of the flux linkage that balances the spring.
Neither the coil nor the core is in it.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.estimators.mhe.model import Gap, gap, make_gap
from gapsense.kernels.elementary import exp
from gapsense.kernels.layout import Array, Scalar, Vector, blank
from gapsense.kernels.linalg import vector
from gapsense.kernels.trace import clip, square, where

LIGHT, FLAT, FARTHEST, STRONGEST = 1e-3, 1e-3, 5.0, 1e6  # beyond these an estimator talks nonsense
NUMBERS = 4  # a, b, q, r
OUTSIDE = 0.1e-3  # way behind a stop on which the magnet's force still changes [m]


class Mover(NamedTuple):
    """The beliefs."""

    gap: Gap
    factor: Scalar  # of the gap law
    bend: Scalar
    stiffness: Scalar  # k [N/m]
    rest: Scalar  # z_sp [m]
    mass: Scalar  # m [kg]
    damping: Scalar  # c [N s/m]
    balance: Scalar = 0.0  # a
    slope: Scalar = 0.0  # b
    lightness: Scalar = 0.0  # q
    drag: Scalar = 0.0  # r


class Motion(NamedTuple):
    """A motion without stops, and its derivatives by (a, b, q, r)."""

    position: Scalar
    velocity: Scalar
    by_position: Annotated[Array, Vector(4)]
    by_velocity: Annotated[Array, Vector(4)]


def make_mover(par: Any) -> Mover:
    """The mover by the parameters of a controller."""
    return Mover(
        gap=make_gap(par),
        factor=par.gap_factor,
        bend=par.gap_bend,
        stiffness=par.spring_stiffness,
        rest=par.spring_rest,
        mass=par.mover_mass,
        damping=par.damping,
    )


def force(z: Scalar, m: Mover) -> Scalar:
    """Force of the spring, towards the upper stop [N]."""
    return m.stiffness * (m.rest - z)


def gap_slopes(z: Scalar, m: Mover) -> tuple[Scalar, Scalar]:
    """R_g' and R_g'' of the corrected gap [1/(H m), 1/(H m^2)]."""
    return gap(z, m.gap, m.factor, m.bend)[1:]


def depth(z: Scalar, m: Mover) -> Scalar:
    """The way from the upper stop, as a share of the stroke."""
    return (m.gap.largest - z) / (m.gap.largest - m.gap.smallest)


def balance(z: Scalar, m: Mover) -> Scalar:
    """B(z): square of the flux linkage that balances the spring [Wb^2]."""
    (slope, _), F = gap_slopes(z, m), force(z, m)
    usual = exp(clip(m.balance + m.slope * depth(z, m), -FARTHEST, FARTHEST))
    B = 2.0 * where(F > LIGHT, F, LIGHT) / where(slope > FLAT, slope, FLAT) * usual
    return where(B < STRONGEST, B, STRONGEST)


def squared_flux(z: Scalar, v: Scalar, a: Scalar, m: Mover) -> Scalar:
    """Square of the flux linkage with which the mover has velocity and acceleration; negative if none has [Wb^2]."""
    inertia = exp(-m.lightness) * (m.mass * a + m.damping * exp(m.drag) * v)
    return balance(z, m) * (1.0 - inertia / where(force(z, m) > LIGHT, force(z, m), LIGHT))


def start_at_rest(z: Scalar) -> Motion:
    """Motion that starts at rest."""
    return blank(Motion, position=z)


def move(at: Motion, squared: Scalar, dt: Scalar, m: Mover) -> Motion:
    """Motion after a time dt in which the square of the flux linkage is given."""
    z = clip(at.position, m.gap.smallest - OUTSIDE, m.gap.largest + OUTSIDE)
    is_inside = where(z == at.position, 1.0, 0.0)
    slope, curvature = gap_slopes(z, m)
    x, light, friction = depth(z, m), exp(m.lightness) / m.mass, m.damping * exp(m.drag) / m.mass
    pull = 0.5 * squared * exp(-(m.balance + m.slope * x))
    free = light * (force(z, m) - pull * slope)
    a = free - friction * at.velocity
    rise = m.slope / (m.gap.largest - m.gap.smallest)
    by_z = -is_inside * light * (m.stiffness + pull * (curvature + slope * rise))
    by_law = vector([light * pull * slope, light * pull * slope * x, free, -friction * at.velocity])
    by_a = by_z * at.by_position - friction * at.by_velocity + by_law
    half = 0.5 * dt
    return Motion(
        at.position + dt * (at.velocity + half * a),
        at.velocity + dt * a,
        at.by_position + dt * (at.by_velocity + half * by_a),
        at.by_velocity + dt * by_a,
    )


def squares(before: Scalar, after: Scalar) -> Scalar:
    """Mean of the squares of two samples of a flux linkage."""
    return 0.5 * (square(before) + square(after))
