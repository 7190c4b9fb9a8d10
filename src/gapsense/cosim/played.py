"""Signals of the scenario that inputs follow: samples, and what holds between them."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from gapsense.cosim.scenario import Experiment, Port

Vector = npt.NDArray[np.float64]
INTERPOLATIONS = ("linear", "hold")
SLACK = 1e-9  # of a base step: a sample due at the same time up to rounding has its value
BLOCK = 4096  # base steps computed at once


@dataclass(frozen=True, eq=False)
class Played:
    """Values at rising times; between them they are interpolated, or each holds until the next."""

    times: Vector  # [s]
    values: Vector
    interpolation: str = INTERPOLATIONS[0]
    unit: str = ""  # that a file says

    def at(self, times: Vector, slack: float = 0.0) -> Vector:
        """Values at some times within the samples."""
        if self.interpolation == "linear":
            between: Vector = np.interp(times, self.times, self.values)
            return between
        places = np.searchsorted(self.times, times + slack, side="right") - 1
        held: Vector = self.values[np.clip(places, 0, None)]
        return held


def player(
    signals: Mapping[Port, Played], index: Mapping[Port, int], buffer: array[float], experiment: Experiment
) -> Callable[[int], None]:
    """Function of the base step that puts the value of each signal, at the time of that step, into the buffer."""
    if not signals:
        return lambda k: None
    places = [index[port] for port in signals]
    begin, rows = -BLOCK, list[list[float]]()

    def play(k: int) -> None:
        nonlocal begin, rows
        if not begin <= k < begin + BLOCK:
            begin = k
            times = experiment.start + np.arange(k, k + BLOCK, dtype=np.float64) * experiment.base_step
            slack = SLACK * experiment.base_step
            rows = np.array([signal.at(times, slack) for signal in signals.values()]).T.tolist()
        for place, value in zip(places, rows[k - begin]):
            buffer[place] = value

    return play


def first(play: Callable[[int], None], step: Callable[[int], None]) -> Callable[[int], None]:
    """Function of the base step that plays the signals before the components step."""

    def both(k: int) -> None:
        play(k)
        step(k)

    return both
