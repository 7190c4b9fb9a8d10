"""Soft landing: the cycle of [RTS] Fig. 5, and the like for other actuators, strokes and durations.

Before each motion a constant voltage, found by root finding, brings the flux to where the magnet balances the spring at
the very start of the motion.  Then the position is a polynomial of degree five, and the voltage is that of the inverse
model (`inverse_actuator`).  After the making the hold voltage is applied, after the breaking none.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.actuators.motion import MOVING, OPEN
from gapsense.actuators.reluctance_actuator import Inputs, Parameters, State, make_actuator
from gapsense.kernels.layout import blank
from gapsense.studies.devices import RTS_VALVE
from gapsense.studies.runs import after

from .inverse import Cycle, SoftLandingError, Vector
from .phases import Setup, balancing_voltage, move, rest
from .trajectory import FIG_5, Motion, Trajectory

PARTS = 7  # of a cycle
INSTANT = 1e-12  # [s]; times that are closer are the same


class Samples(NamedTuple):
    """What an estimator gets of a cycle, and the truth beside it; arrays (N,)."""

    time: Vector
    voltage: Vector
    current: Vector
    mode: Vector
    position: Vector
    velocity: Vector
    flux_linkage: Vector


def soft_landing(
    actuator: Parameters = RTS_VALVE,
    trajectory: Trajectory = FIG_5,
    step: float = 2e-6,
    cycles: int = 2,
    highest_voltage: float = 200.0,
    progress: Progress = lambda done, total: None,
) -> list[Cycle]:
    """Cycles of making and breaking without impact, from a core that was never magnetized.

    Parameters
    ----------
    actuator : Parameters
        The actuator, with its stops and its options; its initial position and micro-step are of no importance.
    trajectory : Trajectory
        When it moves.
    step : float
        Distance of the samples at most, and step of the integration at rest [s].
    cycles : int
        Number of cycles; the remanence of the core repeats from the second one on.
    highest_voltage : float
        Beyond it, and beyond its negative, the drive cannot go [V].
    progress : callable, optional
        Called after each part of a cycle with parts done and parts in all.

    Raises
    ------
    SoftLandingError
        If the motion is impossible for this actuator or this drive, with the instant and the reason.
    """
    check(actuator, trajectory, step)
    par = actuator._replace(micro_step=step)
    fixed = Setup(par, make_actuator(Inputs(0.0, 0.0, 0.0), par), highest_voltage)
    state = blank(State, position=actuator.stop_upper, mode=OPEN)
    found = []
    for k in range(cycles):
        cycle, state = _cycle(fixed, trajectory, state, after(progress, PARTS * k, PARTS * cycles))
        found.append(cycle)
    return found


@cache
def reference() -> Cycle:
    """The cycle of Fig. 5 from the second one on; studies share it, as it takes a second."""
    return soft_landing()[-1]


def check(actuator: Parameters, trajectory: Trajectory, step: float) -> None:
    """Refuse what cannot be a cycle; all problems at once."""
    if unknown := [f"`{name}` is {value}" for name, value in trajectory._asdict().items() if not math.isfinite(value)]:
        raise SoftLandingError(f"{', '.join(unknown)}: finite numbers are expected.")
    c, lower, upper = trajectory, actuator.stop_lower, actuator.stop_upper
    making_end, breaking_end = c.making_start + c.making_duration, c.breaking_start + c.breaking_duration
    shortest, latest = min(step, c.lead, c.making_duration, c.breaking_duration), c.period + INSTANT
    problems = {
        f"`stop_lower` of {lower} m must be below `stop_upper` of {upper} m": lower < upper,
        f"`spring_rest` of {actuator.spring_rest} m must be above `stop_upper` of {upper} m, or nothing holds the "
        "mover there": actuator.spring_rest > upper,
        "`step`, `lead`, `making_duration` and `breaking_duration` must be positive": shortest > 0.0,
        f"the voltage of the making begins {c.lead} s before `making_start` of {c.making_start} s, before the "
        "period": c.making_start >= c.lead,
        f"the voltage of the breaking begins {c.lead} s before `breaking_start` of {c.breaking_start} s, before the "
        f"making has landed at {making_end:.6g} s": c.breaking_start - c.lead >= making_end - INSTANT,
        f"the breaking lands at {breaking_end:.6g} s, after the period of {c.period} s": breaking_end <= latest,
    }
    if found := [text for text, is_right in problems.items() if not is_right]:
        raise SoftLandingError("; ".join(found) + ".")


def sampled(cycle: Cycle, sample_time: float = 20e-6) -> Samples:
    """Samples at k T_s, from the start of the period to its end.

    At a jump the voltage is that just before it; at the instant of a contact the mover is on its stop.
    """
    time = sample_time * np.arange(math.floor(cycle.time[-1] / sample_time + 1e-6) + 1)
    k = np.searchsorted(cycle.time, time - INSTANT)  # first row at the sample or after it
    is_row, left = cycle.time[k] <= time + INSTANT, np.maximum(k - 1, 0)
    weight = np.where(is_row, 1.0, (time - cycle.time[left]) / np.where(is_row, 1.0, cycle.time[k] - cycle.time[left]))

    def at(values: Vector) -> Vector:
        return np.asarray(np.where(is_row, values[k], (1.0 - weight) * values[left] + weight * values[k]))

    following = np.minimum(k + 1, cycle.time.size - 1)
    lands = (cycle.mode[k] == MOVING) & is_row & (cycle.time[following] <= time + INSTANT)
    columns = {name: at(getattr(cycle, name)) for name in Samples._fields}
    return Samples(**{**columns, "time": time, "mode": cycle.mode[np.where(lands, following, k)]})


def _cycle(run: Setup, c: Trajectory, state: State, done: Callable[[int], None]) -> tuple[Cycle, State]:
    """One cycle: rest, lead and motion, for the making and for the breaking."""
    upper, lower = run.par.stop_upper, run.par.stop_lower
    making = Motion(c.making_start, c.making_duration, upper, lower)
    breaking = Motion(c.breaking_start, c.breaking_duration, lower, upper)
    parts = []
    for begin, voltage, m in ((0.0, 0.0, making), (making.start + making.duration, c.hold_voltage, breaking)):
        waiting, state = rest(run, state, begin, m.start - c.lead, voltage)
        lead, state = rest(run, state, m.start - c.lead, m.start, balancing_voltage(run, state, m, c.lead))
        moving, state = move(run, state, m)
        parts += [waiting, lead, moving]
        done(len(parts))
    waiting, state = rest(run, state, breaking.start + breaking.duration, c.period, 0.0)
    done(PARTS)
    return Cycle(*(np.concatenate(columns) for columns in zip(*parts, waiting))), state
