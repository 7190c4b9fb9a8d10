"""The voltage of soft-landing cycles as a short table for a drive, and how well the actuator then follows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gapsense._os.files import write_atomically
from gapsense._os.workers import Progress
from gapsense.actuators.motion import MOVING
from gapsense.actuators.reluctance_actuator import Inputs, Parameters

from .inverse import Cycle, Vector
from .phases import KERNEL, parts

PIECES = 100  # per motion
TOLD = 1000  # steps between two reports of progress


def voltage_table(cycles: Sequence[Cycle], pieces: int = PIECES) -> tuple[Vector, Vector]:
    """Times [s] and voltages [V] of consecutive cycles, linear in between; a time that comes twice is a jump.

    In each motion it is the line of so many `pieces` of least squares: its error has no mean on any pair of pieces, so
    that it hardly changes the flux.  With 100 pieces the valve of [RTS] follows to 5e-10 m; a line through points of
    the voltage, which lies on one side of a curve all along, is some hundred times worse.
    """
    times, voltages = [], []
    for k, cycle in enumerate(cycles):
        for part in parts(cycle):
            t, u = cycle.time[part], cycle.voltage[part]
            is_constant = t.size == 1 or cycle.mode[part[0]] != MOVING
            knots = t[[0, -1]] if is_constant else np.linspace(t[0], t[-1], min(pieces, t.size // 4) + 1)
            times.append(k * cycle.time[-1] + knots)
            voltages.append(u[[0, -1]] if is_constant else _line(t, u, knots))
    return _without_repetitions(np.concatenate(times), np.concatenate(voltages))


def write(path: Path, times: Vector, voltages: Vector) -> Path:
    """Write a table that DriveVoltage reads."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows, heads = np.column_stack([times, voltages]), "time [s],voltage [V]"
    write_atomically(path, lambda file: np.savetxt(file, rows, "%.12g", ",", header=heads, comments=""))
    return path


def played(
    actuator: Parameters,
    times: Vector,
    voltages: Vector,
    step: float = 1e-6,
    progress: Progress = lambda done, total: None,
) -> tuple[Vector, Vector]:
    """Times k `step` and the positions there [m], of the actuator under the mean of the table over each step."""
    points = step * np.arange(round(times[-1] / step) + 1)
    means = np.diff(_integral(times, voltages, points)) / step
    state, _ = KERNEL.initial(Inputs(0.0, 0.0, 0.0), actuator)
    positions = [state.position]
    for k, (t, mean) in enumerate(zip(points[1:].tolist(), means.tolist())):
        if k % TOLD == 0:
            progress(k, means.size)
        state, _ = KERNEL.step(state, Inputs(t, step, mean), actuator)
        positions.append(state.position)
    return points, np.array(positions)


def deviation(cycles: Sequence[Cycle], times: Vector, positions: Vector) -> float:
    """Largest distance between `positions` and those of consecutive cycles [m]."""
    wanted = np.concatenate([c.position for c in cycles])
    at = np.concatenate([c.time + k * c.time[-1] for k, c in enumerate(cycles)])
    return float(np.abs(positions - np.interp(times, at, wanted)).max())


def _line(t: Vector, u: Vector, knots: Vector) -> Vector:
    """Values at `knots` of the broken line nearest to `u`."""
    k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, knots.size - 2)
    w = (t - knots[k]) / (knots[k + 1] - knots[k])
    hats = np.zeros((t.size, knots.size))
    hats[np.arange(t.size), k] = 1.0 - w
    hats[np.arange(t.size), k + 1] += w
    return np.asarray(np.linalg.lstsq(hats, u, rcond=None)[0])


def _without_repetitions(times: Vector, voltages: Vector) -> tuple[Vector, Vector]:
    """The same rows without those between two others of the same time, which only a value before and after need."""
    is_between = (np.diff(times, prepend=-np.inf) == 0.0) & (np.diff(times, append=np.inf) == 0.0)
    is_again = (np.diff(times, prepend=-np.inf) == 0.0) & (np.diff(voltages, prepend=np.inf) == 0.0)
    kept = ~(is_between | is_again)
    return times[kept], voltages[kept]


def _integral(times: Vector, voltages: Vector, at: Vector) -> Vector:
    """Integral of the table from its first row [V s]."""
    lengths = np.diff(times)
    sums = np.concatenate([[0.0], np.cumsum(0.5 * lengths * (voltages[1:] + voltages[:-1]))])
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, times.size - 2)
    x, length = at - times[k], np.where(lengths[k] > 0.0, lengths[k], 1.0)
    return np.asarray(sums[k] + x * (voltages[k] + 0.5 * x * (voltages[k + 1] - voltages[k]) / length))
