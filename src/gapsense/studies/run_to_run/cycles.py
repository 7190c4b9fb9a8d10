"""Actuators of one law from cycle to cycle: how hard they land, what they take, how they move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.control.judging import LOWER, MOVING, UPPER
from gapsense.control.run_to_run import BACK
from gapsense.studies.run_to_run import forward, searches
from gapsense.studies.run_to_run.chain import Running
from gapsense.studies.run_to_run.conditions import CONDITIONS, Condition, drifted, samples
from gapsense.studies.run_to_run.loops import LAWS, OF_LAW, RECORDED, Loop, controller, loop_of
from gapsense.studies.tasks import Facts

Floats = npt.NDArray[np.float64]
NEVER = 2.0  # impact speed of an operation that did not arrive [m/s]
DRAWN, AT = 6, (0, 1, 2, 5, 10, 20)  # actuators, and cycles besides the last one, whose motions are kept
EVERY = 100e-6  # of a motion that is kept [s]
DIGITS = 7
VOLTS = "volts"  # the voltage that is recorded


class Cycle(NamedTuple):
    """One cycle of some actuators."""

    speeds: Floats  # hardest impact of closing and of opening [m/s], (2, runs)
    energy: Floats  # supplied [J], (runs,)
    is_ordinary: Floats  # 1: by the controller's own will, and not the first one
    warnings: Floats  # of the controller
    position: Floats  # [m], (samples, runs)


class Outcome(NamedTuple):
    """What became of some actuators."""

    speeds: Floats  # (cycles, 2, runs)
    energy: Floats  # (cycles, runs)
    is_ordinary: Floats  # (cycles, runs)
    warnings: Floats  # (cycles, runs)
    mass: Floats  # [kg], (runs,)
    motions: Mapping[str, Floats]  # of a cycle, (samples, actuators) [m]


NUMBERS = Outcome._fields[:-1]


def of_task(setting: Facts, task: Facts) -> dict[str, Any]:
    """Task: an outcome as lists."""
    runs = range(task["first"], task["first"] + task["runs"])
    found = outcome(task["law"], CONDITIONS[task["condition"]], setting["seed"], runs, task["cycles"])
    motions = {cycle: _short(z) for cycle, z in found.motions.items()}
    return {**{name: _short(getattr(found, name)) for name in NUMBERS}, "motions": motions}


def _short(values: Floats) -> Any:
    return np.round(values, DIGITS).tolist()


def read(found: Facts) -> Outcome:
    """The outcome of a task."""
    numbers = (np.array(found[name]) for name in NUMBERS)
    return Outcome._make([*numbers, {cycle: np.array(z) for cycle, z in found["motions"].items()}])


def outcome(law: str, condition: Condition, seed: int, runs: range, cycles: int) -> Outcome:
    """Some of the actuators of a seed, from their first cycle on."""
    loop = loop_of(law, condition, seed, runs)
    made = [*gone(law, loop, condition, len(runs), cycles)]
    every, shown = round(EVERY / condition.sample_time), max(0, DRAWN - runs.start)
    kept = [k for k in {*AT, cycles - 1} if k < cycles]
    motions = {str(k): made[k].position[::every, :shown] for k in sorted(kept) if shown}
    mass = np.broadcast_to(loop.par["plant.mover_mass"][0], len(runs))
    rows = zip(*(cycle[:-1] for cycle in made))
    speeds, energy, is_ordinary, warnings = (np.array(row) for row in rows)
    return Outcome(speeds, energy, is_ordinary, warnings, mass, motions)


def gone(law: str, loop: Loop, condition: Condition, runs: int, cycles: int) -> Iterator[Cycle]:
    """The cycles of a loop; a search learns from each but the first one, which is an ordinary one."""
    dt, counts = condition.sample_time, samples(condition)
    told, is_search = controller(condition), LAWS[law].kind == "given"
    volts = forward.nominal(counts, told) if law == "nominal" else forward.ordinary(counts, told)
    given = np.transpose([np.arange(counts[0]) < counts[1], volts])
    trials = searches.begun(law, runs, told) if is_search else None
    running = Running(loop.chain, loop.par, [0.0, 0.0], dt, runs)
    for cycle in range(cycles):
        par = {**loop.par, **(searches.columns(trials) if trials else {}), **_drifted(loop, condition, cycle, cycles)}
        found = cycle_of(running.go(par, given), counts[1], dt)
        trials = searches.told(trials, found.speeds) if trials and cycle else trials
        yield found


def _drifted(loop: Loop, condition: Condition, cycle: int, cycles: int) -> dict[str, Floats]:
    factors = drifted(condition, cycle, cycles)
    return {f"plant.{name}": factor * loop.par[f"plant.{name}"] for name, factor in factors.items()}


def cycle_of(recorded: Floats, closed: int, dt: float) -> Cycle:
    """What is recorded of a cycle, (samples, signals, runs); `closed` of the samples are closed."""
    signals = dict(zip((*RECORDED, VOLTS, *OF_LAW), np.swapaxes(recorded, 0, 1)))
    position, mode, current, impact, volts = (signals[name] for name in (*RECORDED, VOLTS))
    halves = ((slice(closed), LOWER), (slice(closed, None), UPPER))
    speeds = np.array([hardest(mode[half], impact[half], stop) for half, stop in halves])
    before = np.concatenate([current[-1:], current[:-1]])  # a cycle begins as the one before
    energy = dt * np.sum(volts * 0.5 * (before + current), axis=0)
    state, warnings = (signals.get(name, np.zeros_like(mode)) for name in OF_LAW)
    return Cycle(speeds, energy, np.any(state == BACK, axis=0) * 1.0, warnings[-1], position)


def hardest(mode: Floats, impact: Floats, stop: float) -> Floats:
    """Hardest impact of an operation that is to end at a stop, (runs,) of (samples, runs)."""
    has_left = np.logical_or.accumulate(mode == MOVING)  # before that, the impact is an older one
    has_arrived = has_left[-1] & (mode[-1] == stop)
    return np.where(has_arrived, np.max(np.where(has_left, impact, 0.0), axis=0), NEVER)
