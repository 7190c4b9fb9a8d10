"""Numbers computed from recorded signals, and whether they lie within their bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim.scenario import Metric

if TYPE_CHECKING:
    from gapsense.cosim.record import Result

Vector = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]
Window = tuple[float | None, float | None]  # `after` and `before`


class Samples(NamedTuple):
    """Rows that a metric looks at, and the times that they are about."""

    rows: Rows
    times: Vector


@dataclass(frozen=True)
class MetricKind:
    """A function of the samples (less their reference, where there is one), and its use of a reference.

    With `axis` it is a function of samples and reference signal: of the curve that one draws against the other. If it
    `takes_times` the times of the samples [s] since the beginning of the window follow.
    """

    compute: Callable[..., float]
    reference: Literal["required", "optional", "none", "axis"]
    what: str
    takes_times: bool = False


def rms(error: Vector) -> float:
    """Square root of the mean square."""
    return float(np.sqrt(np.mean(error**2)))


def loop_area(y: Vector, x: Vector) -> float:
    """Area inside the closed curve of y over x, positive if it is run through anticlockwise."""
    return float(0.5 * np.sum((np.roll(x, -1) + x) * (np.roll(y, -1) - y)))


def intercept(y: Vector, x: Vector) -> float:
    """Mean of |y| where x changes its sign, interpolated; NaN if it never does."""
    k = np.flatnonzero((x[:-1] < 0.0) != (x[1:] < 0.0))
    at_zero = y[k] - x[k] * (y[k + 1] - y[k]) / (x[k + 1] - x[k])
    return float(np.mean(np.abs(at_zero))) if k.size else math.nan


def first_above(signal: Vector, times: Vector) -> float:
    """Time at which a signal is above 0 for the first time, infinite if it never is."""
    above = np.flatnonzero(signal > 0.0)
    return float(times[above[0]]) if above.size else math.inf


KINDS: Mapping[str, MetricKind] = {
    "rmse": MetricKind(rms, "required", "Root mean square of the difference"),
    "max_abs": MetricKind(lambda error: float(np.max(np.abs(error))), "optional", "Greatest absolute value"),
    "mean_abs": MetricKind(lambda error: float(np.mean(np.abs(error))), "optional", "Mean absolute value"),
    "mean": MetricKind(lambda error: float(np.mean(error)), "optional", "Mean"),
    "std": MetricKind(lambda error: float(np.std(error)), "optional", "Standard deviation"),
    "final": MetricKind(lambda error: float(error[-1]), "optional", "Last sample"),
    "min": MetricKind(lambda signal: float(np.min(signal)), "optional", "Least sample"),
    "max": MetricKind(lambda signal: float(np.max(signal)), "optional", "Greatest sample"),
    "increase": MetricKind(lambda error: float(error[-1] - error[0]), "optional", "Last sample less the first"),
    "fraction": MetricKind(lambda signal: float(np.mean(signal != 0.0)), "none", "Share of the samples that are not 0"),
    "until_above": MetricKind(
        first_above, "required", "Time [s] from `after` to the first sample above the reference, or infinite", True
    ),
    "until_below": MetricKind(
        lambda signal, times: first_above(-signal, times),
        "required",
        "Time [s] from `after` to the first sample below the reference, or infinite",
        True,
    ),
    "loop_area": MetricKind(loop_area, "axis", "Area inside the closed curve, positive if it is run anticlockwise"),
    "intercept": MetricKind(intercept, "axis", "Mean absolute value where the reference changes its sign"),
}


@dataclass(frozen=True)
class Measured:
    """Value of a metric with its unit and bounds; NaN where there were no samples."""

    name: str
    value: float
    unit: str
    bounds: tuple[float, float] | None
    description: str = ""
    published: float | None = None
    table: str = ""
    label: str = ""

    @property
    def passed(self) -> bool:
        """True if the value is finite and within its bounds, or has none."""
        if self.bounds is None:
            return math.isfinite(self.value)
        return self.bounds[0] <= self.value <= self.bounds[1]

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        span = "" if self.bounds is None else f", bounds {self.bounds[0]:.6g} to {self.bounds[1]:.6g}{unit}"
        return f"{self.name} = {self.value:.6g}{unit}{span}"


def measure_all(metrics: Iterable[Metric], result: Result) -> dict[str, Measured]:
    """All metrics of a result by name."""
    samples, units = finder(result), result.units
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite or no number is outside of any bounds
        return {metric.name: measured(metric, result, samples(metric), units) for metric in metrics}


def finder(result: Result) -> Callable[[Metric], Samples]:
    """Function that gives the samples of a metric: at rows at which the component of its signal has just stepped.

    They are found once for all metrics that look at the same ones.
    """

    @cache
    def stepped(component: str) -> Rows:
        return np.flatnonzero(result.stepped(component))

    @cache
    def inside(component: str, where: str | None, time: str | None, window: Window) -> Samples:
        rows = stepped(component)
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


def measured(metric: Metric, result: Result, samples: Samples, units: Mapping[str, str]) -> Measured:
    """One metric over its samples."""
    kind, signal, other = KINDS[metric.kind], result[metric.signal][samples.rows], reference(metric, result, samples)
    arguments = (signal, other) if kind.reference == "axis" else (signal - other,)
    if kind.takes_times:
        begin = window(metric, result)[0]
        arguments = (*arguments, samples.times - (result.run.start if begin is None else begin))
    value = kind.compute(*arguments) if signal.size else math.nan
    shown = (metric.description, metric.published, metric.table, metric.label)
    return Measured(metric.name, value, unit_of(metric, units), metric.bounds, *shown)


def unit_of(metric: Metric, units: Mapping[str, str]) -> str:
    """Unit of a metric: that of its signal, of an area that times that of its reference."""
    if metric.kind == "loop_area":
        return f"{units.get(metric.signal, '')}.{units.get(str(metric.reference), '')}"
    if KINDS[metric.kind].takes_times:
        return "s"
    return "" if metric.kind == "fraction" else units.get(metric.signal, "")


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
