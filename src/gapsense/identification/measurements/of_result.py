"""Columns of the results of `gapsense run`.

The signals are found by their names and read at the instants at which their components have stepped.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from gapsense.cosim.result.result import Result
from gapsense.identification.measurements.record import NEEDED, Columns, Vector
from gapsense.problems import listing, suggest

# Where a result has its signals, best first.  The mean over the step knows an edge inside it, the value does not.
SIGNALS = {
    "voltage": ("voltage_measured", "voltage_mean", "voltage"),
    "current": ("current_measured", "current"),
    "position": ("position",),
    "mode": ("mode_measured", "mode"),
}


def columns_of(file: str, result: Result, names: Mapping[str, str], problems: list[str]) -> Columns:
    """Signals of a result where they have just been sampled; a mean voltage is averaged between these instants."""
    chosen = {q: s for q in SIGNALS if (s := _signal(file, q, names, result, problems))}
    if any(q not in chosen for q in NEEDED[1:]):
        return Columns(file, np.array([], dtype=int), {})
    is_mean = chosen["voltage"].endswith("_mean")
    sampled = [chosen["current"]] if is_mean else [chosen["voltage"], chosen["current"]]
    at = np.flatnonzero(np.logical_and.reduce([result.stepped(signal) for signal in sampled]))
    values = {"time": result.times[at], **{q: result[s][at] for q, s in chosen.items()}}
    if is_mean:
        values["voltage"] = _averaged(result[chosen["voltage"]], at)
    return Columns(file, at + 2, values, is_mean)


def _signal(file: str, quantity: str, names: Mapping[str, str], result: Result, problems: list[str]) -> str | None:
    """The signal that holds a quantity; of an optional one that is not unique, none."""
    if quantity in names:
        if names[quantity] in result.signals:
            return names[quantity]
        problems.append(f"{file}: no signal `{names[quantity]}`. {suggest(names[quantity], result.signals)}")
        return None
    found: list[str] = []
    for ending in SIGNALS[quantity]:
        found = found or [signal for signal in result.signals if signal.rpartition(".")[2] == ending]
    if len(found) == 1:
        return found[0]
    if quantity in NEEDED:
        what = f"{listing(found)} may be the {quantity}" if found else f"no signal of the {quantity} is recorded"
        problems.append(f"{file}: {what}. Choose one with `--column {quantity}=SIGNAL`.")
    return None


def _averaged(means: Vector, at: npt.NDArray[np.int_]) -> Vector:
    """Mean over the rows from one of `at` to the next."""
    running = np.concatenate(([0.0], np.cumsum(means)))
    return np.concatenate((means[at[:1]], np.diff(running[at + 1]) / np.diff(at)))
