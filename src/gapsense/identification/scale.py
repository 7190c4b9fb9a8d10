"""The tuning of estimators that goes with the size of a device. `Mhe` gets its model error and windows from what
records show, `Ekf` and `Ertss` get their process noise from a table and the supply.

The defaults are those of a valve of 0.4 A that moves within 2 ms, and stay as they are where they fit.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from gapsense.estimators.ekf import USUAL
from gapsense.estimators.mhe.model import Parameters
from gapsense.estimators.mhe.window import GUESS
from gapsense.identification.measurements.record import Record
from gapsense.identification.measurements.signals import edges, true_runs
from gapsense.identification.residual import FLOOR, Residual
from gapsense.identification.valve.form import TURNOVER
from gapsense.identification.valve.model import JUMP, Trajectory

LARGEST = 5e-3  # of the largest current: a model's error that is no more than believed
SLOW = 2.0  # times `window.tail`, that a motion may last with it
ROOM = 2.0  # times what an operation needs, that the longest window is
MOST = 1998  # samples of a window; `Mhe` has 2000
FINEST = 0.075  # of `window.tail`, that a sample may last
DIGITS = 4
SOLID, UNTOLD = 5e3, 2e3  # S; eddy currents, for one turn, of a solid core and of an unknown one
GUESSED = ("core.eddy", "core.turnover", "process.current_error")  # what goes with them
DRIFT = 8e-3  # of the voltage: what is wrong of its integral
MEMORY = 0.66e-3  # s; with which they forget an error of the current


def find_tuning(
    records: Sequence[Record], models: Sequence[Trajectory], residuals: Sequence[Residual], known: Parameters
) -> dict[str, float]:
    """Find the parameters of `Mhe` that differ from those that are known, by name."""
    largest = max(float(np.abs(record.current).max()) for record in records)
    left = [float(np.sqrt(r.rms**2 - r.noise**2)) for r in residuals if not r.is_explained]
    dt, spans = records[0].dt, [spans_of(record, model) for record, model in zip(records, models)]
    motion, landing = (max(column) for column in zip(*spans))
    tail = max(float(known.window_tail), motion if motion > SLOW * known.window_tail else 0.0, dt / FINEST)
    longest = ROOM * (landing + tail)
    found = {
        "model.error": max(*left, FLOOR * largest, min(float(known.model_error), LARGEST * largest)),
        "window.tail": tail,
        "window.longest": min(max(float(known.window_longest), longest), MOST * dt),
    }
    rounded = {name: float(f"{x:.{DIGITS}g}") for name, x in found.items()}
    return {name: x for name, x in rounded.items() if x != getattr(known, name.replace(".", "_"))}


def untold_losses(turns: float, saturation: float, told: Collection[str] = ()) -> dict[str, float]:
    """Losses of `Mhe` that are only a guess; eddy currents that were given are not."""
    eddy = {} if "core.eddy" in told else {"core.eddy": UNTOLD / turns**2, "prior.eddy": GUESS}
    return {name: float(f"{x:.{DIGITS}g}") for name, x in {**eddy, "core.turnover": TURNOVER * saturation}.items()}


def process_noise(volts: float, turns: float, error: float) -> dict[str, float]:
    """That of `Ekf` and `Ertss` for a device of which only the static model is known, and that to `error` [A]."""
    off = math.hypot(error, SOLID * volts / turns**2)
    rate = math.sqrt(2.0 * USUAL / MEMORY)
    found = {"process.flux_linkage": DRIFT * volts * USUAL, "process.current_error": off * rate}
    return {name: float(f"{x:.{DIGITS}g}") for name, x in found.items()}


def spans_of(record: Record, model: Trajectory) -> tuple[float, float]:
    """How long the longest motion lasts, and how long after an edge of the voltage the last one lands [s]."""
    v, z = record.voltage[record.times.size - model.position.size :], model.position
    moving = true_runs(np.diff(z) != 0.0)
    begins = np.array([a for a, _ in edges(v, JUMP)])
    lands = [b - begins[begins < b][-1] for _, b in moving if (begins < b).any()]
    lengths = [b - a for a, b in moving]
    return record.dt * max(lengths, default=0), record.dt * float(max(lands, default=0))
