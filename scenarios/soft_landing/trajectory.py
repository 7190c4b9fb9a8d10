"""When a mover moves, and how: a polynomial of degree five from stop to stop."""

from __future__ import annotations

from typing import NamedTuple


class Trajectory(NamedTuple):
    """When the mover moves, and what voltage holds it; the stops are those of the actuator."""

    period: float = 20e-3  # [s]
    making_start: float = 1e-3  # [s]
    making_duration: float = 4e-3  # [s]
    breaking_start: float = 11e-3  # [s]
    breaking_duration: float = 4e-3  # [s]
    hold_voltage: float = 20.0  # from the landing of the making on [V]
    lead: float = 1e-3  # the constant voltage before a motion starts so much earlier [s]


FIG_5 = Trajectory()


class Motion(NamedTuple):
    """Position as a polynomial of degree five in time, without velocity and acceleration at both ends."""

    start: float  # [s]
    duration: float  # [s]
    first: float  # gap at the start [m]
    last: float  # gap at the end [m]


class Mechanics(NamedTuple):
    """The motion at one instant."""

    position: float
    velocity: float
    acceleration: float
    jerk: float


def mechanics(t: float, m: Motion) -> Mechanics:
    """Position and its derivatives at time `t`."""
    s, travel = (t - m.start) / m.duration, m.last - m.first
    share = _smooth_step(s) if s < 0.5 else 1.0 - _smooth_step(1.0 - s)  # exact at both ends
    return Mechanics(
        position=(1.0 - share) * m.first + share * m.last,
        velocity=travel / m.duration * 30.0 * s**2 * (1.0 - s) ** 2,
        acceleration=travel / m.duration**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
        jerk=travel / m.duration**3 * 60.0 * (1.0 - 6.0 * s * (1.0 - s)),
    )


def _smooth_step(s: float) -> float:
    return s**3 * (10.0 - s * (15.0 - 6.0 * s))
