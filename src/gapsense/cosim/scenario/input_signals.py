"""Signals of the scenario that inputs follow: samples, and what holds between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from gapsense.cosim.scenario.elements import Experiment, Port

Vector = npt.NDArray[np.float64]
Matrix = npt.NDArray[np.float64]
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


class Player:
    """Values that go to places of the buffer at each base step; `rows` gives those from one on, many at once."""

    def __init__(self, places: Sequence[int], rows: Callable[[int], Matrix]) -> None:
        self.places, self.rows = np.array(places, dtype=np.int64), rows
        self.begin, self.block = 0, np.empty((0, len(places)))

    def provide(self, k: int) -> int:
        """Have the values of a base step; the last one of which there are some."""
        if not self.begin <= k < self.begin + len(self.block):
            self.begin, self.block = k, np.ascontiguousarray(self.rows(k))
        return self.begin + len(self.block) - 1

    def into(self, buffer: Vector) -> Callable[[int], None]:
        """Function of the base step that puts its values into the buffer."""

        def play(k: int) -> None:
            self.provide(k)
            buffer[self.places] = self.block[k - self.begin]

        return play if len(self.places) else lambda k: None


def player(signals: Mapping[Port, Played], index: Mapping[Port, int], experiment: Experiment) -> Player:
    """What plays the signals of a scenario: the value of each at the time of the base step."""

    def rows(k: int) -> Matrix:
        times = experiment.start + np.arange(k, k + BLOCK, dtype=np.float64) * experiment.base_step
        slack = SLACK * experiment.base_step
        values = np.array([signal.at(times, slack) for signal in signals.values()])
        return values.reshape(len(signals), BLOCK).T

    return Player([index[port] for port in signals], rows)
