"""What a scenario is made of: components, their ports, the wires between these, the grid of time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from gapsense.tables import Value

FAR = 2.0**53  # base steps, more than any run has: what is farther away is not told apart
STEP_LIMIT = 60.0  # [s]


class Port(NamedTuple):
    """A variable of a component, written `component.variable` (the variable may itself contain dots)."""

    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}"


@dataclass(frozen=True)
class Experiment:
    """Time grid `start + k * base_step` [s], k from 0 to `count`, and how values are exchanged on it."""

    start: float
    stop: float
    base_step: float
    count: int
    method: str = "gauss-seidel"
    pace: float | None = None  # simulated seconds per second of wall time; None: as fast as possible
    isolation: str = "none"  # or the run is in a process of its own
    step_limit: float = STEP_LIMIT  # wall time [s] of one step of a component in another process

    def time(self, index: int) -> float:
        """Time of base step `index` [s], computed by multiplication so that errors do not add up."""
        return self.start + index * self.base_step


@dataclass(frozen=True)
class Component:
    """One FMU instance; its step and offset are in base steps."""

    name: str
    fmu: str
    step: int = 1
    offset: int = 0
    values: Mapping[str, Value] = field(default_factory=dict)  # of parameters
    origin: Mapping[str, str] = field(default_factory=dict)  # file or table that gives each of them
    sets: Mapping[Path, Iterable[str]] = field(default_factory=dict)  # names in its parameter sets, see `taken`
    isolation: str = "none"  # or the instance is in a process of its own


@dataclass(frozen=True)
class Connection:
    """`target` receives `factor * source + bias`; `unit` is that after the conversion, `place` where it is written.

    A connection that is `delayed` carries the value of one step before: its target steps before its source.
    """

    source: Port
    target: Port
    factor: float | None = None
    bias: float | None = None
    unit: str | None = None
    delayed: bool = False
    place: str = ""

    @property
    def converts(self) -> bool:
        """True if the connection states a conversion, and so may join different units."""
        return self.factor is not None or self.bias is not None

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


# Times of events on the grid of base steps.


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
