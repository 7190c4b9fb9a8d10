"""Results: recorded signals with everything needed to understand them, as arrays and as files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.files import read_columns, write_with_facts
from gapsense.cosim.result.metrics import KINDS, Measured
from gapsense.cosim.result.sidecar import FORMAT, absolute, read_whole, relative
from gapsense.cosim.scenario.records import Metric, Span, Vector
from gapsense.cosim.show import pages, plots
from gapsense.problems import suggest
from gapsense.tables import Value

Rows = npt.NDArray[np.intp]
Window = tuple[float | None, float | None]  # `after` and `before`
TIME = {"time": "s"}


@dataclass(frozen=True)
class Signal:
    """Unit, nominal value and causality of a recorded signal, from the model description."""

    unit: str
    nominal: float
    causality: str


@dataclass(frozen=True)
class Timing:
    """Wall time of a component: setting inputs, stepping and reading outputs, over all its steps."""

    seconds: float
    calls: int
    median: float | None = None  # of one step [s]; None in results of older versions, and without a step
    longest: float | None = None  # step [s]

    @property
    def microseconds(self) -> float:
        """Time per component-step [us]."""
        return 1e6 * self.seconds / self.calls if self.calls else 0.0


@dataclass(frozen=True)
class Iterations:
    """How often a loop was evaluated to solve it, in how many steps."""

    steps: int
    evaluations: int
    most: int  # of them in one step
    at: float  # end of that step [s]

    @property
    def mean(self) -> float:
        """Evaluations per step."""
        return self.evaluations / self.steps


@dataclass(frozen=True)
class Steps:
    """How long the steps were that were controlled, and how many were done again, shorter."""

    done: int
    rejected: int  # pairs of steps
    shortest: float  # [s]
    longest: float
    beyond: int  # pairs that were as short as they may be, and still off by more than they should
    worst: float  # what a pair that counts was off by, of the nominal value
    at: float  # end of that [s]
    of: str  # the signal that was off by that


@dataclass(frozen=True)
class Run:
    """What was run and how: enough to repeat it, and to tell it from another."""

    title: str
    scenario: str
    variant: str | None
    method: str
    start: float
    stop: float
    base_step: float
    decimation: int
    seeds: Mapping[str, int]
    components: Mapping[str, Mapping[str, Any]]  # for each its FMU, GUID, version, hash, step and offset
    order: tuple[str, ...]  # in which they step
    delayed: tuple[str, ...]  # connections that carry the value of one step before
    files: Mapping[str, str]  # hashes of the scenario's files
    versions: Mapping[str, str]  # of the software
    overruns: int = 0  # late base steps of a run with a pace
    lag: float = 0.0  # the worst lateness [s]
    source: str = ""  # scenario file; in the side-car it is relative to the result
    figure: str = "overview"  # that shows it
    wires: tuple[str, ...] = ()  # all connections
    direct: tuple[str, ...] = ()  # connections to inputs with direct feedthrough
    remarks: tuple[str, ...] = ()  # on what falls between its steps
    settings: Mapping[str, Value] = field(default_factory=dict)  # that were laid over the scenario
    loops: Mapping[str, Iterations] = field(default_factory=dict)  # by the components that repeat steps together
    steps: Steps | None = None  # where they were controlled
    boards: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # of components on one: see `OnBoard.facts`


@dataclass(frozen=True, repr=False)
class Result:
    """Recorded signals of a run, complete or not: the rows up to an interruption or a failure are valid."""

    run: Run
    times: Vector  # of the rows [s]
    signals: Mapping[str, Vector]  # recorded values by `component.variable`; also `result["valve.position"]`
    about: Mapping[str, Signal]
    parameters: Mapping[str, Value]  # by `component.parameter`, as read back from the FMUs
    timing: Mapping[str, Timing]  # of each component
    wall: float  # wall time of the run, without loading the FMUs [s]
    interrupted: bool = False
    ended: str = ""  # by which components in an orderly way, if any did
    failure: str = ""  # why a component failed, if one did
    metrics: Mapping[str, Measured] = field(default_factory=dict)  # empty for a run that did not reach its end
    messages: tuple[tuple[str, int, str], ...] = ()  # logged: component, status, text
    events: tuple[Span, ...] = ()  # of the scenario, that happened, in the order of their beginnings

    def __getitem__(self, name: str) -> Vector:
        if name not in self.signals:
            raise KeyError(f"`{name}` was not recorded. {suggest(name, self.signals)}")
        return self.signals[name]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each signal; empty where the FMU states none."""
        return {name: signal.unit for name, signal in self.about.items()}

    @property
    def base_step(self) -> float:
        """Base step [s]."""
        return self.run.base_step

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per second of wall time."""
        span = float(self.times[-1] - self.times[0]) if self.times.size else 0.0
        return span / self.wall if self.wall > 0.0 else 0.0

    def stepped(self, signal: str) -> npt.NDArray[np.bool_]:
        """Rows at which the component of a signal has just stepped; the initial value is not one of them."""
        component = self.run.components[signal.partition(".")[0]]
        since = np.arange(self.times.size) * self.run.decimation - int(component["offset"])
        has_stepped: npt.NDArray[np.bool_] = (since > 0) & (since % int(component["step"]) == 0)
        return has_stepped

    def plot(self, *patterns: str) -> Any:
        """Figure of the recorded signals of these names or patterns, by default all: a panel per unit."""
        return plots().signals(self, patterns)

    def to_pandas(self) -> Any:
        """The signals as a DataFrame of pandas, by time [s]; units are in its `attrs["units"]`."""
        return pages().frame(self.signals, "time", self.times, self.units)

    def __repr__(self) -> str:
        span = f" from {self.times[0]:.6g} s to {self.times[-1]:.6g} s" if self.times.size else ""
        states = (("interrupted", self.interrupted), ("failed", bool(self.failure)))
        bad = sum(not m.passed for m in self.metrics.values())
        parts = (
            f"{self.times.size} rows{span}",
            f"{len(self.signals)} signals",
            f"{len(self.metrics)} metrics" + (f" ({bad} outside their bounds)" if bad else ""),
            *(["ended by a component"] if self.ended else []),
            *(word for word, holds in states if holds),
        )
        return f"<Result {self.run.scenario!r}: {', '.join(parts)}>"

    def _repr_html_(self) -> Any:
        return pages().of_result(self.run.title, repr(self), self.metrics, self.signals, self.units)

    def save(self, path: str | Path) -> Path:
        """Write `path` (CSV) and its side-car of the same name (JSON), which tells the hash of the CSV.

        The folder is made if there is none. Both files are written before one of them takes its place. A kill between
        leaves two that do not fit, which `read_result` refuses.
        """
        path = Path(path).with_suffix(".csv")
        columns, units = {"time": self.times, **self.signals}, {**TIME, **self.units}
        write_with_facts(path, columns, units, lambda digest: self.sidecar(digest, path.parent))
        return path

    def sidecar(self, digest: str, folder: Path) -> dict[str, Any]:
        """Everything but the signals, as JSON takes it, with the hash of the CSV and what is relative to its folder."""
        return {
            "format": FORMAT,
            "sha256": digest,
            "interrupted": self.interrupted,
            "ended": self.ended,
            "failure": self.failure,
            "rows": int(self.times.size),
            "run": {**asdict(self.run), "source": relative(self.run.source, folder)},
            "signals": {name: asdict(signal) for name, signal in self.about.items()},
            "parameters": self.parameters,
            "metrics": {name: write_measured(measured) for name, measured in self.metrics.items()},
            "timing": {name: asdict(timing) for name, timing in self.timing.items()},
            "wall": self.wall,
            "realtime_factor": self.realtime_factor,
            "messages": self.messages,
            "events": [span._asdict() for span in self.events],
        }


Measure = Callable[[Result], Mapping[str, float]]


def read_result(path: str | Path) -> Result:
    """Result that was saved as `path` (CSV) and its side-car, equal bit for bit.

    An InputError tells if the two files are not those of one run, by their hash, or no result at all.
    """
    path = Path(path)
    data, content = read_whole(path)
    units = {**TIME, **{name: signal["unit"] for name, signal in data["signals"].items()}}
    columns, about = read_columns(path, units, content), data["run"]
    about |= {name: tuple(about[name]) for name in ("order", "delayed", "wires", "direct", "remarks") if name in about}
    about["loops"] = {name: Iterations(**item) for name, item in about.get("loops", {}).items()}
    about["steps"] = Steps(**about["steps"]) if about.get("steps") else None
    return Result(
        run=Run(**{**about, "source": absolute(about["source"], path.parent)}),
        times=columns.pop("time"),
        signals=columns,
        about={name: Signal(**item) for name, item in data["signals"].items()},
        parameters=data["parameters"],
        timing={name: Timing(**item) for name, item in data["timing"].items()},
        wall=data["wall"],
        interrupted=data["interrupted"],
        ended=data.get("ended", ""),  # older results have none
        failure=data["failure"],
        metrics={name: read_measured(item) for name, item in data["metrics"].items()},
        messages=tuple((name, status, text) for name, status, text in data["messages"]),
        events=tuple(Span(**item) for item in data.get("events", ())),  # older results have none
    )


def write_measured(measured: Measured) -> dict[str, Any]:
    """JSON form of a metric; JSON has no number for NaN and infinity, so these are texts."""
    value, *bounds = (x if math.isfinite(x) else str(x) for x in (measured.value, *(measured.bounds or ())))
    return {**asdict(measured), "value": value, "bounds": bounds or None}


def read_measured(item: dict[str, Any]) -> Measured:
    """Metric from its JSON form."""
    bounds = item["bounds"] and tuple(map(float, item["bounds"]))
    return Measured(**{**item, "value": float(item["value"]), "bounds": bounds})


# The metrics of a result: which samples each looks at, and its number.


class Samples(NamedTuple):
    """Rows that a metric looks at, and the times that they are about."""

    rows: Rows
    times: Vector


def measure_all(metrics: Iterable[Metric], result: Result) -> dict[str, Measured]:
    """All metrics of a result by name."""
    samples, units = finder(result), result.units
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite or no number is outside of any bounds
        return {metric.name: measure_metric(metric, result, samples(metric), units) for metric in metrics}


def finder(result: Result) -> Callable[[Metric], Samples]:
    """Function that gives the samples of a metric: at rows at which the component of its signal has just stepped.

    They are found once for all metrics that look at the same ones.
    """
    find_steps = cache(lambda component: np.flatnonzero(result.stepped(component)))

    @cache
    def inside(component: str, where: str | None, time: str | None, window: Window) -> Samples:
        """Rows at which a component has stepped, `where` is not 0, and the time lies in the window."""
        rows = find_steps(component)
        if where is not None:
            rows = rows[result[where][rows] != 0.0]
        times = result.times[rows] if time is None else result[time][rows]
        are_inside = within(window, times, 1e-9 * result.base_step)
        return Samples(rows[are_inside], times[are_inside])

    return lambda metric: inside(metric.signal.partition(".")[0], metric.where, metric.time, window(metric, result))


def window(metric: Metric, result: Result) -> Window:
    """Between which times its samples lie; between none if it counts from an event that did not happen."""
    if metric.event is None:
        return metric.after, metric.before
    begin = next((span.begin for span in result.events if span.name == metric.event), math.inf)
    return begin + (metric.after or 0.0), None if metric.before is None else begin + metric.before


def measure_metric(metric: Metric, result: Result, samples: Samples, units: Mapping[str, str]) -> Measured:
    """Measure one metric over its samples."""
    kind, signal, other = KINDS[metric.kind], result[metric.signal][samples.rows], reference(metric, result, samples)
    arguments: tuple[Vector | float, ...] = (signal, other) if kind.reference == "axis" else (signal - other,)
    if kind.takes_flows:
        names = (metric.signal, str(metric.reference), *(metric.flows or ()))
        arguments = tuple(held(result, name)[samples.rows] for name in names)
    if kind.takes_times:
        begin = window(metric, result)[0]
        arguments = (*arguments, samples.times - (result.run.start if begin is None else begin))
    value = kind.compute(*arguments) if signal.size else math.nan
    shown = (metric.description, metric.published, metric.table, metric.label)
    return Measured(metric.name, value, unit_of(metric, units), metric.bounds, *shown)


def held(result: Result, name: str) -> Vector:
    """Values of a signal as they were in the steps that end at the rows: with Jacobi a row has the next inputs."""
    values = result[name]
    return np.concatenate((values[:1], values[:-1])) if is_late(result, name) else values


def is_late(result: Result, name: str) -> bool:
    """True if the value that a signal had in a step stands in the row where the step begins."""
    return result.run.method == "jacobi" and result.about[name].causality == "input"


def within(window: Window, times: Vector, slack: float) -> npt.NDArray[np.bool_]:
    """Which times lie strictly inside a window; one within the slack of a limit counts as on it."""
    after, before = window
    low, high = -math.inf if after is None else after, math.inf if before is None else before
    inside: npt.NDArray[np.bool_] = (times > low + slack) & (times < high - slack)
    return inside


def reference(metric: Metric, result: Result, samples: Samples) -> Vector | float:
    """What the samples are compared with: a recorded signal, a parameter, a number, or nothing (0)."""
    if metric.reference is None:
        return 0.0
    if not isinstance(metric.reference, str):
        return float(metric.reference)
    if metric.reference not in result.signals:
        return float(result.parameters[metric.reference])
    values: Vector = result.signals[metric.reference]
    return values[samples.rows] if metric.time is None else at_times(values, result, samples.times)


def at_times(values: Vector, result: Result, times: Vector) -> Vector:
    """Values of a signal at the rows nearest to these times; NaN where there is no row within half a row's step."""
    rows = np.rint((times - result.times[0]) / (result.base_step * result.run.decimation))
    inside = (rows >= 0) & (rows < values.size)
    return np.where(inside, values[np.where(inside, rows, 0).astype(np.intp)], math.nan)


def unit_of(metric: Metric, units: Mapping[str, str]) -> str:
    """Unit of a metric: that of its signal, of an area that times that of its reference."""
    if metric.kind == "loop_area":
        return f"{units.get(metric.signal, '')}.{units.get(str(metric.reference), '')}"
    if KINDS[metric.kind].takes_times:
        return "s"
    return "" if metric.kind in ("fraction", "bond") else units.get(metric.signal, "")
