"""Times of events on the grid of base steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gapsense.cosim.scenario.elements import Experiment


FAR = 2.0**53  # base steps, more than any run has: what is farther away is not told apart


def nearest(steps: float) -> int:
    """The whole number of base steps nearest to another one."""
    return round(max(-FAR, min(steps, FAR)))


def index_of(time: float, experiment: Experiment) -> int:
    """The base step nearest to a time [s]."""
    return nearest((time - experiment.start) / experiment.base_step)


def is_on_grid(time: float, experiment: Experiment) -> bool:
    """True if a time [s] is that of a base step up to rounding."""
    slack = 1e-9 * experiment.base_step + 1e-15 * (abs(experiment.start) + abs(time))
    return abs(experiment.time(index_of(time, experiment)) - time) <= slack


def steps_of(length: float | None, experiment: Experiment) -> int:
    """A length of time [s] in base steps; 0 for none."""
    return 0 if length is None else nearest(length / experiment.base_step)


def neighbours(time: float, experiment: Experiment) -> tuple[float, float]:
    """Times of the base steps before and after a time [s] between them."""
    k = index_of(time, experiment)
    first = k if experiment.time(k) < time else k - 1
    return experiment.time(first), experiment.time(first + 1)
