"""The metrics of a result: which samples each looks at, and its number."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim.result.metrics import KINDS, Measured, Vector, unit_of
from gapsense.cosim.result.result import Result
from gapsense.cosim.scenario.records import Metric

Rows = npt.NDArray[np.intp]
Window = tuple[float | None, float | None]  # `after` and `before`


class Samples(NamedTuple):
    """Rows that a metric looks at, and the times that they are about."""

    rows: Rows
    times: Vector


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
