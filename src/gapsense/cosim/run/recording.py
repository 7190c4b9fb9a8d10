"""What a run leaves behind, and the marks that say what it is doing at any moment, even after it has crashed."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import frexp, ldexp
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.processes import MARKS, Died, Marks
from gapsense.cosim.fmu.instance import FmuError
from gapsense.cosim.scenario.records import Port, Scenario
from gapsense.tables import Value

BINS, OF_OCTAVE, LEAST = 512, 16, -26  # the first one begins at 2**LEAST s, and takes all that is shorter
Counts = npt.NDArray[np.int64]
# Marks: what goes on; the component that it goes on in, its place in execution order + 1; the base step that is being
# done; the rows recorded; whether to end after this base step.
PHASE, COMPONENT, STEP, ROWS, STOP = range(5)
LOADING, STARTING, STEPPING, ENDING = range(4)
DOING = ("while it was loaded", "at its initialization", "in its step", "at its end")
MASTER = 0  # in the place of a component


def new_marks() -> Marks:
    """Marks that nobody shares."""
    return array("q", bytes(8 * MARKS))


class Take(NamedTuple):
    """What one run takes beside the scenario: places of the buffer to record, seeds, values of parameters."""

    columns: list[int]
    seeds: Mapping[str, int]
    values: Mapping[Port, Value]


@dataclass
class Recording:
    """What a run leaves behind, complete or not."""

    data: npt.NDArray[np.float64]
    rows: int = 0  # of the data, recorded
    parameters: dict[str, Value] = field(default_factory=dict)  # as read back, by `component.parameter`
    seconds: list[float] = field(default_factory=list)  # wall time of each component, in execution order
    calls: list[int] = field(default_factory=list)  # steps of each
    warnings: list[int] = field(default_factory=list)  # steps of each that returned a warning
    longest: list[float] = field(default_factory=list)  # wall time of one step of each
    spread: Counts = field(default_factory=lambda: counts(0))  # steps of each by how long they took
    messages: list[tuple[str, int, str]] = field(default_factory=list)  # component, status, text
    wall: float = 0.0  # [s]
    begun: float | None = None  # `perf_counter` since when the wall time is still to be added
    overruns: int = 0  # late base steps of a run with a pace
    lag: float = 0.0  # the worst lateness [s]
    interrupted: bool = False
    ended: str = ""  # by which components in an orderly way, before its stop or there
    error: FmuError | None = None
    events: list[list[Any]] = field(default_factory=list)  # that happened: name, base steps of begin and end

    def start(self, parts: int) -> Recording:
        """Begin to count the steps of so many components."""
        self.seconds, self.longest = [0.0] * parts, [0.0] * parts
        self.calls, self.warnings, self.spread = [0] * parts, [0] * parts, counts(parts)
        return self

    def clocked(self) -> float:
        """Wall time until now [s]."""
        return self.wall + (0.0 if self.begun is None else perf_counter() - self.begun)

    def facts(self) -> dict[str, Any]:
        """All but the data, as JSON takes it."""
        error = self.error and [self.error.instance, self.error.cause, self.error.time, self.error.step, self.error.log]
        plain = asdict(replace(self, data=np.empty(0), error=None, wall=self.clocked(), begun=None))
        return {**plain, "data": None, "error": error, "spread": self.spread.tolist()}


def from_facts(data: npt.NDArray[np.float64], facts: Mapping[str, Any]) -> Recording:
    """Recording of its data and the rest."""
    said = [(component, status, text) for component, status, text in facts["messages"]]
    error = None
    if facts["error"]:
        instance, cause, time, step, log = facts["error"]
        error = FmuError(instance, cause, time=time, step=step, log=log)
    spread = np.array(facts["spread"], dtype=np.int64).reshape(-1, BINS)
    return Recording(**{**facts, "data": data, "messages": said, "error": error, "spread": spread})


def counts(parts: int) -> Counts:
    """Room to count the steps of so many components, by how long they take."""
    return np.zeros((parts, BINS), dtype=np.int64)


def death(scenario: Scenario, order: Sequence[str], died: Died, marks: Marks) -> FmuError:
    """What the end of its process means for a run: which component it came from, and when."""
    doing, step = DOING[marks[PHASE]], marks[STEP]
    if marks[COMPONENT] == MASTER:
        return FmuError("run", f"{died.cause}, between two calls of components.", log=died.words)
    name = order[marks[COMPONENT] - 1]
    if marks[PHASE] != STEPPING:
        return FmuError(name, f"{died.cause}, {doing}.", log=died.words)
    begin = scenario.experiment.time(step - scenario.components[name].step)
    return FmuError(name, f"{died.cause}, {doing}.", time=begin, step=step, log=died.words)


# How long steps took: a histogram of fixed size, so that a median costs a run no memory and 5 ns per step.
#
# Bins are what the leading bits of a double are: 16 for each octave, of equal width in it, from 15 ns to 64 s. A median
# from them is exact to the width of one, 6 %, and mostly to 1 %, since it is interpolated. loop.c has the same bins.


def bin_of(seconds: float) -> int:
    """Bin of a duration."""
    mantissa, exponent = frexp(seconds)  # of which the first is from 0.5 to 1
    found = (exponent - 2 - LEAST) * OF_OCTAVE + int(2 * OF_OCTAVE * mantissa)
    return 0 if seconds <= 0.0 else min(max(found, 0), BINS - 1)


def bin_edge(k: int) -> float:
    """Duration at which bin `k` begins [s]."""
    octave, part = divmod(k, OF_OCTAVE)
    return ldexp(1.0 + part / OF_OCTAVE, octave + LEAST)


def median(counts: Counts, longest: float) -> float | None:
    """Median of the durations that were counted, of which the longest is known [s]; None if there are none."""
    total = np.cumsum(counts)
    if not total[-1]:
        return None
    half = 0.5 * float(total[-1])
    k = int(np.searchsorted(total, half))
    share = 1.0 - (float(total[k]) - half) / float(counts[k])
    return min(bin_edge(k) + share * (bin_edge(k + 1) - bin_edge(k)), longest)
