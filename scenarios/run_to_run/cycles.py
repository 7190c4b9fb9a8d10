"""Actuators of one law from cycle to cycle: how hard they land, what they take, how they move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.control.judging import LOWER, MOVING, UPPER
from gapsense.control.run_to_run import BACK
from gapsense.studies.runs import Facts

from . import forward, searches
from .chain import Running
from .conditions import CHANGED, CONDITIONS, Condition, Disturbance, factors, samples
from .loops import ADDED, AT_REST, COMMAND, ENABLE, LAWS, OF_LAW, RECORDED, VOLTAGE, Loop, controller, loop_of

Floats = npt.NDArray[np.float64]
NEVER = 2.0  # impact speed of an operation that did not arrive [m/s]
DRAWN, AT = 6, (0, 1, 2, 5, 10, 20)  # actuators, and cycles besides the last one, whose motions are kept
EVERY = 100e-6  # of a motion that is kept [s]
DIGITS = 7
STRUCK = 110  # sample of a closing, in motion, whose reading is wild or lost
VOLTS = "volts"  # the voltage that is recorded


class Cycle(NamedTuple):
    """One cycle of some actuators."""

    speeds: Floats  # hardest impact of closing and of opening [m/s], (2, runs)
    energy: Floats  # supplied [J], (runs,)
    is_ordinary: Floats  # 1: by the controller's own will, and not the first one
    warnings: Floats  # of the controller
    states: Floats  # of that at the end of closing and of opening, (2, runs)
    said: Floats  # its warnings there
    position: Floats  # [m], (samples, runs)


class Outcome(NamedTuple):
    """What became of some actuators."""

    speeds: Floats  # (cycles, 2, runs)
    energy: Floats  # (cycles, runs)
    is_ordinary: Floats  # (cycles, runs)
    warnings: Floats  # (cycles, runs)
    states: Floats  # (cycles, 2, runs)
    said: Floats  # (cycles, 2, runs)
    mass: Floats  # [kg], (runs,)
    ordinary: Floats  # impact speeds of ordinary switching, (cycles, 2, runs); of one cycle if no cycle has others
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
    every, shown = round(EVERY / condition.sample_time), max(0, DRAWN - runs.start)
    rows, motions = [], {}
    for k, cycle in enumerate(gone(law, loop, condition, len(runs), cycles)):
        rows.append(cycle[:-1])
        if shown and k in {*AT, cycles - 1}:
            motions[str(k)] = cycle.position[::every, :shown].copy()
    mass = np.broadcast_to(loop.par["plant.mover_mass"][0], len(runs))
    numbers = [np.array(column) for column in zip(*rows)]
    is_other = law != "ordinary" and bool(condition.drift or condition.step)
    ordinary = outcome("ordinary", condition, seed, runs, cycles).speeds if is_other else numbers[0][:1]
    return Outcome._make([*numbers, mass, ordinary, motions])


def gone(law: str, loop: Loop, condition: Condition, runs: int, cycles: int) -> Iterator[Cycle]:
    """The cycles of a loop."""
    for cycle, recorded in enumerate(recorded_cycles(law, loop, condition, runs, cycles)):
        yield cycle_of(recorded, samples(condition, cycle)[1], condition.sample_time)


def recorded_cycles(law: str, loop: Loop, condition: Condition, runs: int, cycles: int) -> Iterator[Floats]:
    """What is recorded of each cycle; a search learns from each but the first one, which is an ordinary one."""
    dt, told, is_search = condition.sample_time, controller(condition), LAWS[law].kind == "given"
    volts = cache(partial(forward.nominal if law == "nominal" else forward.ordinary, par=told))
    trials = searches.begun(law, runs, told) if is_search else None
    running = Running(
        made=loop.chain, par=loop.par, given=[AT_REST[name] for name in loop.chain.given], dt=dt, runs=runs
    )
    for cycle in range(cycles):
        counts = samples(condition, cycle)
        par = {**loop.par, **(searches.columns(trials) if trials else {}), **_changed(loop, condition, cycle, cycles)}
        signals = _given(condition, cycle, counts, volts(counts))
        recorded = running.go(par, np.transpose([signals[name] for name in loop.chain.given]))
        if trials and cycle:
            trials = searches.told(trials, cycle_of(recorded, counts[1], dt).speeds)
        yield recorded


def _given(condition: Condition, cycle: int, counts: tuple[int, int], volts: Floats) -> dict[str, Floats]:
    """What is given at every sample of a cycle."""
    error, k = condition.disturbance or Disturbance(), np.arange(counts[0])
    is_on, added = np.ones(k.size), np.full(k.size, error.step if cycle >= CHANGED else 0.0)
    if cycle == CHANGED:
        added[STRUCK] += error.spike
        is_on[: counts[1]] = not error.is_missed
    return {COMMAND: k < counts[1], VOLTAGE: volts, ENABLE: is_on, ADDED: added}


def _changed(loop: Loop, condition: Condition, cycle: int, cycles: int) -> dict[str, Any]:
    """Parameters that are others in a cycle."""
    plant = {f"plant.{name}": x * loop.par[f"plant.{name}"] for name, x in factors(condition, cycle, cycles).items()}
    error = condition.disturbance
    lower = error.supply * np.random.default_rng(cycle).uniform() if error else 0.0
    return {**plant, **({"supply.gain": np.full((1, 1), 1.0 - lower)} if error else {})}


def cycle_of(recorded: Floats, closed: int, dt: float) -> Cycle:
    """What is recorded of a cycle, (samples, signals, runs); `closed` of the samples are closed."""
    signals = dict(zip((*RECORDED, VOLTS, *OF_LAW), np.swapaxes(recorded, 0, 1)))
    position, mode, current, impact, volts = (signals[name] for name in (*RECORDED, VOLTS))
    halves = ((slice(closed), LOWER), (slice(closed, None), UPPER))
    speeds = np.array([hardest(mode[half], impact[half], stop) for half, stop in halves])
    before = np.concatenate([current[-1:], current[:-1]])  # a cycle begins as the one before
    energy = dt * np.sum(volts * 0.5 * (before + current), axis=0)
    state, warnings = (signals.get(name, np.zeros_like(mode)) for name in OF_LAW)
    is_ordinary, ends = np.any(state >= BACK, axis=0) * 1.0, [closed - 1, -1]
    return Cycle(
        speeds=speeds,
        energy=energy,
        is_ordinary=is_ordinary,
        warnings=warnings[-1],
        states=state[ends],
        said=warnings[ends],
        position=position,
    )


def hardest(mode: Floats, impact: Floats, stop: float) -> Floats:
    """Hardest impact of an operation that is to end at a stop, (runs,) of (samples, runs)."""
    has_left = np.logical_or.accumulate(mode == MOVING)  # before that, the impact is an older one
    has_arrived = has_left[-1] & (mode[-1] == stop)
    return np.where(has_arrived, np.max(np.where(has_left, impact, 0.0), axis=0), NEVER)
