"""What is drawn, as data: curves in panels, strips of signals that have few values, and what is left out of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gapsense.cosim import Result
from gapsense.cosim.result.result import Samples, finder, reference
from gapsense.cosim.scenario.records import Metric

Vector = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]
SIGMAS = 2.0  # half the width of a band, in standard deviations
FEW = 12  # values of a signal that is shown as a strip
STD, VARIANCE = "_std", "_variance"
PIECES = 2000  # of a strip
MOST = 4096  # points of a curve
ALL = 400_000  # points of all curves of a result, which is some 4 MB


@dataclass(frozen=True)
class Curve:
    """Values over time [s], in SI units; `band` is their uncertainty; others are compared with what `is_truth`."""

    name: str
    times: Vector
    values: Vector
    band: Vector | None = None
    is_truth: bool = False
    is_held: bool = True  # until the next time, as a host sees it; else the values are of single times

    @property
    def component(self) -> str:
        """Component that it is of."""
        return self.name.partition(".")[0]


@dataclass(frozen=True)
class Panel:
    """Curves of one unit over one axis; `limit` says that the curves are to lie within their bands around zero."""

    title: str
    unit: str
    curves: tuple[Curve, ...]
    is_error: bool = False
    note: str = ""


@dataclass(frozen=True)
class Strip:
    """A signal that has few values: pieces that begin at `times` [s]; the last one ends at `end`."""

    name: str
    times: Vector
    values: Vector
    end: float


def is_discrete(values: Vector, unit: str) -> bool:
    """True for a signal without a unit that has a few whole values."""
    if unit not in ("", "1") or not values.size or not np.isfinite(values).all():
        return False
    found = np.unique(values)
    return bool(found.size <= FEW and (found == np.round(found)).all())


def strip(result: Result, name: str) -> Strip:
    """A signal that has few values."""
    rows = changes(result[name], PIECES)
    return Strip(name, result.times[rows], result[name][rows], float(result.times[-1]))


def deviation(result: Result, name: str) -> str | None:
    """Signal that has the standard deviation of another, or its variance."""
    own = (name + STD, name + VARIANCE)
    return next((other for other in own if other in result.signals), None)


def is_deviation(result: Result, name: str) -> bool:
    """True for a signal that is shown as the band of another."""
    return any(name.endswith(end) and name.removesuffix(end) in result.signals for end in (STD, VARIANCE))


def band(result: Result, name: str) -> Vector | None:
    """Half the width of a signal's band, where there is one."""
    if (other := deviation(result, name)) is None:
        return None
    spread = result[other] if other.endswith(STD) else np.sqrt(np.maximum(result[other], 0.0))
    return SIGMAS * np.maximum(spread, 0.0)


def from_signal(result: Result, name: str, is_truth: bool = False) -> Curve:
    """Make the curve of a recorded signal over all rows."""
    return Curve(name=name, times=result.times, values=result[name], band=band(result, name), is_truth=is_truth)


def constant(result: Result, name: str) -> Curve:
    """A parameter, as long as the run."""
    value = float(result.parameters[name])
    return Curve(name, result.times[[0, -1]], np.array([value, value]), is_truth=True)


def from_samples(result: Result, pair: Metric) -> Curve:
    """Make the curve of a signal that is about earlier times, at these."""
    samples, spread = samples_of(result, pair), band(result, pair.signal)
    values = result[pair.signal][samples.rows]
    return Curve(pair.signal, samples.times, values, None if spread is None else spread[samples.rows], is_held=False)


def error(result: Result, pair: Metric) -> Curve:
    """An estimate less its reference, where the estimator has just stepped."""
    samples = samples_of(result, pair)
    values, spread = result[pair.signal][samples.rows] - reference(pair, result, samples), band(result, pair.signal)
    known = np.isfinite(values)
    half = None if spread is None else spread[samples.rows][known]
    return Curve(pair.signal, samples.times[known], values[known], half, is_held=pair.time is None)


def samples_of(result: Result, pair: Metric) -> Samples:
    """Samples by the times that they are about; what is said of times before the record is not shown."""
    samples = finder(result)(pair)
    order = np.argsort(samples.times, kind="stable")
    order = order[samples.times[order] >= result.times[0]]
    return Samples(samples.rows[order], samples.times[order])


def most(curves: int) -> int:
    """Points that each of so many curves may have."""
    return max(200, min(MOST, ALL // max(curves, 1)))


def choose_rows(values: Vector, most: int) -> Rows:
    """Choose rows to show of a curve: all, or else the first, the last, least and greatest of each bucket of rows."""
    if values.size <= most:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, (most - 2) // 2 + 1).astype(np.intp)
    known = np.isfinite(values)
    low = buckets(np.where(known, values, np.inf), edges)
    high = buckets(-np.where(known, values, -np.inf), edges)
    return np.unique(np.concatenate(([0], low, high, [values.size - 1])))


def buckets(values: Vector, edges: Rows) -> Rows:
    """Row of the first least value of each bucket."""
    return np.array([a + int(np.argmin(values[a:b])) for a, b in zip(edges[:-1], edges[1:])], dtype=np.intp)


def changes(values: Vector, most: int) -> Rows:
    """Rows at which a signal has another value than before, the first one included; the first so many of them."""
    rows: Rows = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))
    return rows[:most]
