"""Numbers computed from recorded signals, and whether they lie within their bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from gapsense.cosim.scenario import Metric

if TYPE_CHECKING:
    from gapsense.cosim.record import Result

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MetricKind:
    """A function of the samples (less their reference, where there is one), and its use of a reference."""

    compute: Callable[[Vector], float]
    reference: Literal["required", "optional", "none"]


def rms(error: Vector) -> float:
    """Square root of the mean square."""
    return float(np.sqrt(np.mean(error**2)))


KINDS: Mapping[str, MetricKind] = {
    "rmse": MetricKind(rms, "required"),
    "max_abs": MetricKind(lambda error: float(np.max(np.abs(error))), "optional"),
    "mean_abs": MetricKind(lambda error: float(np.mean(np.abs(error))), "optional"),
    "mean": MetricKind(lambda error: float(np.mean(error)), "optional"),
    "std": MetricKind(lambda error: float(np.std(error)), "optional"),
    "final": MetricKind(lambda error: float(error[-1]), "optional"),
    "min": MetricKind(lambda signal: float(np.min(signal)), "optional"),
    "max": MetricKind(lambda signal: float(np.max(signal)), "optional"),
    "fraction": MetricKind(lambda signal: float(np.mean(signal != 0.0)), "none"),
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


def evaluate(metrics: tuple[Metric, ...], result: Result) -> dict[str, Measured]:
    """Every metric of a scenario over a result, by name."""
    return {metric.name: measure(metric, result) for metric in metrics}


def measure(metric: Metric, result: Result) -> Measured:
    """One metric over the samples of its signal: the rows at which its component has just stepped."""
    rows = np.flatnonzero(result.stepped(metric.signal))
    if metric.where is not None:
        rows = rows[result[metric.where][rows] != 0.0]
    times = result.times[rows] if metric.time is None else result[metric.time][rows]
    inside = window(metric, times, 1e-9 * result.base_step)
    rows, times = rows[inside], times[inside]
    samples = result[metric.signal][rows] - reference(metric, result, rows, times)
    value = KINDS[metric.kind].compute(samples) if samples.size else math.nan
    shown = (metric.description, metric.published, metric.table, metric.label)
    return Measured(metric.name, value, unit_of(metric, result.units), metric.bounds, *shown)


def unit_of(metric: Metric, units: Mapping[str, str]) -> str:
    """Unit of a metric: that of its signal."""
    return "" if metric.kind == "fraction" else units.get(metric.signal, "")


def window(metric: Metric, times: Vector, slack: float) -> npt.NDArray[np.bool_]:
    """Which times lie strictly between `after` and `before`; one within the slack of a limit counts as on it."""
    after = -math.inf if metric.after is None else metric.after
    before = math.inf if metric.before is None else metric.before
    inside: npt.NDArray[np.bool_] = (times > after + slack) & (times < before - slack)
    return inside


def reference(metric: Metric, result: Result, rows: npt.NDArray[np.intp], times: Vector) -> Vector | float:
    """What the samples are compared with: a recorded signal, a parameter, a number, or nothing (0)."""
    if metric.reference is None:
        return 0.0
    if not isinstance(metric.reference, str):
        return float(metric.reference)
    if metric.reference not in result.signals:
        return float(result.parameters[metric.reference])
    values: Vector = result.signals[metric.reference]
    return values[rows] if metric.time is None else at_times(values, result, times)


def at_times(values: Vector, result: Result, times: Vector) -> Vector:
    """Values of a signal at the rows nearest to these times; NaN where there is no row within half a row's step."""
    rows = np.rint((times - result.times[0]) / (result.base_step * result.run.decimation))
    inside = (rows >= 0) & (rows < values.size)
    return np.where(inside, values[np.where(inside, rows, 0).astype(np.intp)], math.nan)
