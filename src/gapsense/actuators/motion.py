"""Mover between two stops, as the hybrid automaton of [SEMERA] Fig. 2.

Mode 1 rests on the stop of the smallest gap, mode 2 moves, mode 3 rests on the stop of the largest gap.  An impact
takes all the velocity.  A stop is left when the net force points inward: a guard on the position would chatter.  Dry
friction has to be overcome for that; a moving mover has all of it but at speeds of the order of `CREEP`.
"""

from __future__ import annotations

from typing import NamedTuple

from gapsense.records import Scalar
from gapsense.trace import fabs, square, where

CLOSED, MOVING, OPEN = 1.0, 2.0, 3.0
CREEP = 2e-3  # speed at which half of the dry friction acts [m/s]


class Mover(NamedTuple):
    """Mass, spring, damper and stops."""

    mass: Scalar  # m [kg]
    stiffness: Scalar  # k_s [N/m]
    rest: Scalar  # h_s, gap at which the spring is relaxed [m]
    damping: Scalar  # c [N s/m]
    lower: Scalar  # h_min [m]
    upper: Scalar  # h_max [m]
    friction: Scalar = 0.0  # dry [N]


def spring_force(h: Scalar, mover: Mover) -> Scalar:
    """Force of the spring along the gap [N], second term of (52)."""
    return mover.stiffness * (mover.rest - h)


def drag(v: Scalar, mover: Mover) -> Scalar:
    """Force of the damper and of dry friction against the motion [N]."""
    return mover.damping * v + mover.friction * (v / (fabs(v) + CREEP))


def kinetic_energy(v: Scalar, mover: Mover) -> Scalar:
    """Energy that an impact turns into heat [J]."""
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
