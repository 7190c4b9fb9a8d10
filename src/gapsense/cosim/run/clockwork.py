"""What comes between base steps: waiting for a pace, and what is told and saved now and then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter, sleep
from typing import NamedTuple

from gapsense.cosim.run.recording import Recording
from gapsense.cosim.scenario.elements import Experiment


def pacer(experiment: Experiment, recording: Recording, done: int) -> Callable[[int], None]:
    """Function that sleeps at the end of a base step until its time has come, and notes when it is late."""
    period = experiment.base_step / (experiment.pace or 1.0)
    begin = perf_counter() - done * period

    def wait(k: int) -> None:
        left = begin + k * period - perf_counter()
        if left > 0.0:
            sleep(left)
        else:
            recording.overruns += 1
            recording.lag = max(recording.lag, -left)

    return wait


class Action(NamedTuple):
    """What is done every so many base steps, and at the end."""

    every: int
    do: Callable[[int], None]


def pauses(actions: Sequence[Action], count: int, done: int) -> tuple[int, Callable[[int], int]]:
    """The next base step after which there is something to do, and the function that does it and gives the next one.

    The loop should not have to ask at each step.
    """

    def following(k: int) -> int:
        return min([count, *(k - k % action.every + action.every for action in actions)])

    def pause(k: int) -> int:
        for action in actions:
            if not k % action.every or k == count:
                action.do(k)
        return following(k)

    return following(done), pause
