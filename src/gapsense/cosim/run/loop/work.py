"""What the loop over base steps has to do, and who steps when: part i at `offset + j * step`, j >= 1."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.processes import Marks
from gapsense.cosim.events.event import Watch
from gapsense.cosim.run.part import Part
from gapsense.cosim.run.recording import Recording
from gapsense.cosim.scenario.elements import Component, Experiment
from gapsense.cosim.scenario.input_signals import Player

# Does base steps up to the one given, and returns the last one done: an earlier one if it was told to stop, if
# Python should look up, or if there is news of a condition.
Advance = Callable[[int], int]


class Work(NamedTuple):
    """A run whose parts are initialised, and whose first base step to do is `begin`.

    Base step 0 is the start: nobody steps, with Jacobi inputs are exchanged, and the first row is recorded.
    """

    parts: Sequence[Part]  # in execution order
    experiment: Experiment
    player: Player
    columns: npt.NDArray[np.int64]  # places of the buffer to record
    decimation: int
    buffer: npt.NDArray[np.float64]
    recording: Recording  # has the seconds and calls of each part
    marks: Marks
    begin: int
    watches: Sequence[Watch] = ()  # conditions of which news end a block


def first_turn(component: Component, begin: int) -> int:
    """The first base step from `begin` on at which a component steps."""
    return component.offset + component.step * (max(0, begin - 1 - component.offset) // component.step + 1)


def first_exchange(component: Component, begin: int) -> int:
    """The first base step from `begin` on at which a component takes inputs, with Jacobi: where a step of it begins."""
    return component.offset if begin <= component.offset else first_turn(component, begin)
