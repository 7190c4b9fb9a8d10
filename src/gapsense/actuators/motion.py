"""Mover between two stops, as the hybrid automaton of [SEMERA] Fig. 2.

Mode 1 rests on the stop of the smallest gap, mode 2 moves, mode 3 rests on the stop of the largest gap. After an impact
the mover goes back with a part of its speed, the coefficient of restitution, until it would hardly rise any more.
Without restitution it stays at once.

The mover leaves a stop when the net force points inward; a guard on the position would chatter. The force has to
overcome dry friction first. On a moving mover dry friction is complete, except at speeds of the order of `CREEP`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import fabs, square, where

CLOSED, MOVING, OPEN = 1.0, 2.0, 3.0
CREEP = 2e-3  # speed at which half of the dry friction acts [m/s]
SLOWEST = 1e-3  # rebound at least, or the mover stays: it would rise by a nanometre or so [m/s]


class Mover(NamedTuple):
    """Mass, spring, damper and stops."""

    mass: Scalar  # m [kg]
    stiffness: Scalar  # k_s [N/m]
    rest: Scalar  # h_s, gap at which the spring is relaxed [m]
    damping: Scalar  # c [N s/m]
    lower: Scalar  # h_min [m]
    upper: Scalar  # h_max [m]
    friction: Scalar = 0.0  # dry [N]
    restitution: Scalar = 0.0  # speed after an impact over that before it


class Contact(NamedTuple):
    """How mover and stops meet."""

    mode: Scalar
    impact: Scalar  # speed of the hardest impact since the mover last left its rest [m/s]


def mover_of(par: Any, friction: Scalar = 0.0) -> Mover:
    """The mover of a plant, whose parameters have these names."""
    return Mover(
        mass=par.mover_mass,
        stiffness=par.spring_stiffness,
        rest=par.spring_rest,
        damping=par.damping,
        lower=par.stop_lower,
        upper=par.stop_upper,
        friction=friction,
        restitution=par.stop_restitution,
    )


def spring_force(h: Scalar, mover: Mover) -> Scalar:
    """Force of the spring along the gap [N], second term of (52)."""
    return mover.stiffness * (mover.rest - h)


def drag(v: Scalar, mover: Mover) -> Scalar:
    """Force of the damper and of dry friction against the motion [N]."""
    return mover.damping * v + mover.friction * (v / (fabs(v) + CREEP))


def kinetic_energy(v: Scalar, mover: Mover) -> Scalar:
    """Energy of the motion [J]."""
    return 0.5 * mover.mass * square(v)


def elastic_energy(h: Scalar, mover: Mover) -> Scalar:
    """Energy of the spring above its relaxed state [J]."""
    return 0.5 * mover.stiffness * square(h - mover.rest)


def inward(mode: Scalar, net_force: Scalar) -> Scalar:
    """Net force away from the stop of `mode` [N]; zero while moving."""
    return (MOVING - mode) * net_force


def clearance(h: Scalar, is_below: Scalar, mover: Mover) -> Scalar:
    """Distance to the lower stop if `is_below`, else to the upper one [m]; negative beyond it."""
    return where(is_below, h - mover.lower, mover.upper - h)


def resting_mode(h: Scalar, mover: Mover) -> Scalar:
    """Mode of a mover placed at `h`, if no force pulls it away."""
    return where(h <= mover.lower, CLOSED, where(h >= mover.upper, OPEN, MOVING))


def leaving(mode: Scalar, net_force: Scalar, friction: Scalar = 0.0) -> Scalar:
    """Mode after the release guard: moving if the net force points inward, by more than the friction."""
    return where(inward(mode, net_force) > friction, MOVING, mode)


def rebound(v: Scalar, restitution: Scalar) -> Scalar:
    """Velocity after an impact at `v` [m/s]; 0 where the mover stays."""
    after = -restitution * v
    return where(fabs(after) < SLOWEST, 0.0, after)


def land_mover(v: Scalar, is_below: Scalar, net_force: Scalar, before: Contact, mover: Mover) -> Contact:
    """Give the contact after an impact at `v`, on a stop where the mover at rest has this net force."""
    at_rest = leaving(where(is_below, CLOSED, OPEN), net_force, mover.friction)
    return Contact(where(rebound(v, mover.restitution) == 0.0, at_rest, MOVING), hardest(v, before.impact))


def hardest(v: Scalar, before: Scalar) -> Scalar:
    """Speed of the hardest of the impacts `before` and one at `v` [m/s]."""
    speed = fabs(v)
    return where(speed > before, speed, before)


def impact_loss(v: Scalar, mover: Mover) -> Scalar:
    """Energy that an impact at `v` turns into heat [J]."""
    return kinetic_energy(v, mover) - kinetic_energy(rebound(v, mover.restitution), mover)


def release_mover(is_released: Scalar, contact: Contact) -> Contact:
    """Release a mover that rested, if it leaves its rest now."""
    return Contact(where(is_released, MOVING, contact.mode), where(is_released, 0.0, contact.impact))
