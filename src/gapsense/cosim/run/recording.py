"""What is run, what a run leaves behind, and the marks that say what it is doing at any moment, even after a crash.

The process that runs a scenario and the one that waits for it share this; only the latter makes results.
"""

from __future__ import annotations

import os
import platform
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from math import frexp, ldexp
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.files import remember, sha256
from gapsense._os.processes import MARKS, Died, Marks
from gapsense.cosim.fmu.descriptions import Descriptions, reader_version
from gapsense.cosim.scenario.records import (
    SECTION,
    Event,
    Order,
    Port,
    Scenario,
    Span,
    execution_order,
    ports,
    recorded_signals,
    resolve_targets,
)
from gapsense.problems import FmuError
from gapsense.tables import Value
from gapsense.version import __version__

if TYPE_CHECKING:
    from gapsense.cosim.result.result import Result, Run, Signal, Steps

known_hash = remember(sha256)
BINS, OF_OCTAVE, LEAST = 512, 16, -26  # the first one begins at 2**LEAST s, and takes all that is shorter
Counts = npt.NDArray[np.int64]
# Marks: what goes on; the component that it goes on in, its place in execution order + 1; the base step that is being
# done; the rows recorded; whether to end after this base step.
PHASE, COMPONENT, STEP, ROWS, STOP = range(5)
LOADING, STARTING, STEPPING, ENDING = range(4)
DOING = ("while it was loaded", "at its initialization", "in its step", "at its end")
MASTER = 0  # in the place of a component


def new_marks() -> Marks:
    """Marks that no other process shares."""
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
    spread: Counts = field(default_factory=lambda: counts(0))  # number of steps of each component, by duration
    messages: list[tuple[str, int, str]] = field(default_factory=list)  # component, status, text
    wall: float = 0.0  # [s]
    begun: float | None = None  # `perf_counter` since when the wall time is still to be added
    overruns: int = 0  # late base steps of a run with a pace
    lag: float = 0.0  # the worst lateness [s]
    interrupted: bool = False
    ended: str = ""  # by which components in an orderly way, before its stop or there
    error: FmuError | None = None
    loop: str = "C"  # language of the loop over base steps
    boards: dict[str, Any] = field(default_factory=dict)  # facts of each component on a board
    events: list[list[Any]] = field(default_factory=list)  # that happened: name, base steps of begin and end
    # Of each loop that is iterated: steps, evaluations, most of them in a step and in which; its inverse Jacobian.
    loops: dict[str, list[int]] = field(default_factory=dict)
    inverses: dict[str, list[list[float]]] = field(default_factory=dict)
    inputs: dict[str, list[float]] = field(default_factory=dict)  # at the last step of components that interpolate
    steps: dict[str, Any] = field(default_factory=dict)  # with `step_control`: how long they were, see `control.py`

    def start(self, parts: int) -> Recording:
        """Begin to count the steps of so many components."""
        self.seconds, self.longest = [0.0] * parts, [0.0] * parts
        self.calls, self.warnings, self.spread = [0] * parts, [0] * parts, counts(parts)
        return self

    def resume(self, saved: Mapping[str, Any], data: npt.NDArray[np.float64]) -> None:
        """Go on from `facts` that were saved, and the rows recorded then."""
        self.rows = saved["rows"]
        self.data[: self.rows] = data
        self.messages = [(component, status, text) for component, status, text in saved["messages"]]
        self.seconds[:], self.calls[:] = saved["seconds"], saved["calls"]
        self.warnings[:] = saved.get("warnings", self.warnings)  # older ones have none
        self.longest[:], self.spread[:] = saved["longest"], saved["spread"]
        self.wall += saved["wall"]
        self.overruns, self.lag = saved["overruns"], saved["lag"]
        for name in ("loops", "inverses", "inputs", "steps"):
            setattr(self, name, saved.get(name, {}))

    def measure_wall(self) -> float:
        """Measure the wall time until now [s]."""
        return self.wall + (0.0 if self.begun is None else perf_counter() - self.begun)

    def facts(self) -> dict[str, Any]:
        """All but the data, as JSON takes it."""
        error = self.error and [self.error.instance, self.error.cause, self.error.time, self.error.step, self.error.log]
        plain = asdict(replace(self, data=np.empty(0), error=None, wall=self.measure_wall(), begun=None))
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
    """Median of the counted durations, of which the longest is known [s]; None if there are none."""
    total = np.cumsum(counts)
    if not total[-1]:
        return None
    half = 0.5 * float(total[-1])
    k = int(np.searchsorted(total, half))
    share = 1.0 - (float(total[k]) - half) / float(counts[k])
    return min(bin_edge(k) + share * (bin_edge(k + 1) - bin_edge(k)), longest)


# What is run: a scenario and its FMUs, with all that their runs have in common, found once.


@dataclass(frozen=True)
class Subject:
    """A scenario and the descriptions of its FMUs."""

    scenario: Scenario
    descriptions: Descriptions

    @cached_property
    def about(self) -> dict[str, Signal]:
        """The signals that are recorded."""
        from gapsense.cosim.result.result import Signal  # here, so that a process that makes no results starts fast

        known = recorded_signals(self.scenario, self.descriptions)
        return {name: Signal(v.unit or "", v.nominal, v.causality) for name, v in known.items()}

    @cached_property
    def columns(self) -> list[int]:
        """Their places in the buffer."""
        return [place for place, port in enumerate(ports(self.descriptions)) if str(port) in self.about]

    @cached_property
    def order(self) -> Order:
        """In which the components act."""
        return order_of(self.scenario, self.descriptions)

    def prepare_events(self, events: Mapping[str, Event]) -> dict[str, Event]:
        """Prepare events with one target each, and with values as FMI takes them."""

        def convert_value(event: Event) -> Event:
            variable = self.descriptions[event.target.component].variables[event.target.variable]
            return event if event.value is None else replace(event, value=variable.number(event.value))

        return {
            name: convert_value(event) for name, event in resolve_targets(events, self.scenario.connections).items()
        }

    @cached_property
    def run(self) -> Run:
        """What is run and how, but for seeds, files and what came of it."""
        from gapsense.cosim.check import on_grid
        from gapsense.cosim.result.result import Run

        scenario, experiment = self.scenario, self.scenario.experiment
        said = [f"{name} = {value}" for name, value in scenario.settings.items()]
        components: dict[str, dict[str, Any]] = {}
        for name, component in scenario.components.items():
            own = self.descriptions[name]
            facts = {key: getattr(own, key) for key in ("guid", "version", "sha256", "fmi")}
            components[name] = {"fmu": own.path.name, **facts, "step": component.step, "offset": component.offset}
        return Run(
            title=scenario.title + (f" ({', '.join(said)})" if said else ""),
            scenario=scenario.name,
            variant=scenario.variant,
            method=experiment.method,
            start=experiment.start,
            stop=experiment.stop,
            base_step=experiment.base_step,
            decimation=scenario.record.decimation,
            seeds={},
            components=components,
            order=self.order.names,
            delayed=tuple(str(connection) for connection in self.order.delayed),
            files={},
            versions=versions(),
            source=str(scenario.path.resolve()),
            figure=scenario.figure,
            wires=tuple(map(str, scenario.connections)),
            remarks=tuple(on_grid(scenario, self.descriptions)),
            settings=scenario.settings,
            direct=tuple(  # of which an output of the target depends directly on what they carry
                str(c)
                for c in scenario.connections
                if c.target.variable in self.descriptions[c.target.component].direct_inputs
            ),
        )

    @cached_property
    def files(self) -> Mapping[str, Path]:
        """Each file of the scenario by its path from the scenario's folder."""
        folder = self.scenario.path.parent.resolve()
        files = [file.resolve() for file in self.scenario.files]
        return {Path(os.path.relpath(file, folder)).as_posix(): file for file in files}

    def hashes(self) -> dict[str, str]:
        """Hash of each file as it is now, and of what stands in none."""
        return {name: known_hash(file) for name, file in self.files.items()} | {**self.scenario.hashes}

    def make_take(self, seed_shift: int = 0, point: int | Mapping[Port, Value] | None = None) -> Take:
        """Tell what one run takes; a point of a sweep, or values of parameters."""
        values = self.scenario.plan.point(point) if isinstance(point, int) else point or {}
        random = {
            event.seed_name: event.seed
            for event in varied_events(self.scenario.events, values, []).values()
            if event.is_random
        }
        seeds = {name: seed + seed_shift for name, seed in {**self.scenario.seeds, **random}.items()}
        return Take(columns=self.columns, seeds=seeds, values=values)


def varied_events(
    events: Mapping[str, Event], values: Mapping[Port, Value], problems: list[str]
) -> Mapping[str, Event]:
    """The events with the values that a sweep gives their keys; what is wrong with these is noted."""
    if not any(port.component == SECTION for port in values):
        return events
    from gapsense.cosim.scenario.read import vary_events

    return vary_events(events, values, problems)


def order_of(scenario: Scenario, descriptions: Descriptions) -> Order:
    """Order in which the components of a scenario act."""
    method = scenario.experiment.method
    return execution_order(list(scenario.components), scenario.connections, descriptions, method)


@cache
def versions() -> dict[str, str]:
    """Versions of what computed the result."""
    found = {"gapsense": __version__, "fmpy": reader_version(), "numpy": np.__version__}
    return {**found, "python": platform.python_version(), "platform": platform.platform()}


# From a recording to a result with its metrics.


def finish_recording(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of a recording with its metrics; raises FmuError with the partial result if a component has failed."""
    from gapsense.cosim.result.result import measure_all

    result = to_result(subject, take, recording)
    if recording.error is not None:
        recording.error.result = replace(result, failure=str(recording.error))
        raise recording.error
    return result if result.interrupted else replace(result, metrics=measure_all(subject.scenario.metrics, result))


def to_result(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of a recording, without metrics."""
    from gapsense.cosim.result.result import Iterations, Result, Timing

    overruns, lag, time = recording.overruns, recording.lag, subject.scenario.experiment.time
    steps = zip(recording.seconds, recording.calls, recording.longest, recording.spread)
    timing = (Timing(s, n, median(spread, longest), longest if n else None) for s, n, longest, spread in steps)
    return Result(
        run=replace(
            subject.run,
            seeds=dict(take.seeds),
            files=subject.hashes(),
            versions={**subject.run.versions, "loop": recording.loop},
            overruns=overruns,
            lag=lag,
            loops={name: Iterations(n[0], n[1], n[2], time(n[3])) for name, n in recording.loops.items()},
            steps=steps_of(recording.steps, subject) if recording.steps else None,
            remarks=(*subject.run.remarks, *said(subject, recording)),
            boards=recording.boards,
        ),
        times=times(subject.scenario, recording.rows),
        signals=dict(zip(subject.about, recording.data[: recording.rows].T.copy())),
        about=subject.about,
        parameters=recording.parameters,
        timing=dict(zip(subject.run.order, timing)),
        wall=recording.wall,
        interrupted=recording.interrupted,
        ended=recording.ended,
        messages=tuple(recording.messages),
        events=tuple(spans(subject.scenario, recording.events)),
    )


def steps_of(told: Mapping[str, Any], subject: Subject) -> Steps:
    """How long steps were that were controlled."""
    from gapsense.cosim.result.result import Steps

    experiment = subject.scenario.experiment
    same = {key: told[key] for key in ("done", "rejected", "beyond", "of")}
    lengths = {key: told[key] * experiment.base_step for key in ("shortest", "longest")}
    worst, at = told["worst"] * (experiment.step_control or 0.0), experiment.time(told["at"])
    return Steps(**same, **lengths, worst=worst, at=at)


def said(subject: Subject, recording: Recording) -> Iterator[str]:
    """Sentences on what components did in the run that is no failure: the end of it, warnings."""
    if recording.ended:
        yield recording.ended
    if beyond := recording.steps.get("beyond"):
        yield (
            f"experiment.step_control: {beyond} pairs of the shortest steps are off by more, the worst in "
            f"`{recording.steps['of']}` by {recording.steps['worst']:.3g} times that. Reduce `base_step`."
        )
    for name, board in recording.boards.items():
        if board["repeated"]:
            what = ", ".join(f"{count} x {trouble}" for trouble, count in board["repeated"].items())
            first = "" if board["first"] is None else f", the first at t = {board['first']:.9g} s"
            yield f"`{name}`: requests to its board `{board['board']}` had to be repeated{first}: {what}."
    from gapsense.cosim.fmu.instance import WARNING, summary

    for name, warnings, calls in zip(subject.run.order, recording.warnings, recording.calls):
        if warnings:
            texts = [text for component, status, text in recording.messages if (component, status) == (name, WARNING)]
            said = f"; the last one says: {summary(texts[-1]).rstrip('.')}" if texts else " without a word"
            yield f"`{name}` returned a warning from {warnings} of {calls} steps{said}."


def spans(scenario: Scenario, happened: Sequence[Sequence[Any]]) -> Iterator[Span]:
    """When each event was on; of an event that was on at the end, the end is not known."""
    time = scenario.experiment.time
    for name, begin, end in happened:
        event = scenario.events[name]
        yield Span(name, str(event.target), event.action, time(begin), end=None if end is None else time(end))


def times(scenario: Scenario, rows: int) -> npt.NDArray[np.float64]:
    """Times of the rows [s], each with the bits of `Experiment.time`."""
    experiment = scenario.experiment
    steps = np.arange(rows, dtype=np.float64) * scenario.record.decimation  # exact: there are fewer than 2**53
    return experiment.start + steps * experiment.base_step


def shape(scenario: Scenario, columns: Sequence[int]) -> tuple[int, int]:
    """Rows and columns of a whole run."""
    return scenario.experiment.count // scenario.record.decimation + 1, len(columns)
