"""What many runs say, in numbers: one column at a time is in memory, or some thousand rows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.many.result import Campaign, quantiles

Bounds = tuple[float, float]
Vector = npt.NDArray[np.float64]
SAMPLED = 50_000  # runs of which correlations are computed
LEVELS = (0.0, 0.05, 0.5, 0.95, 1.0)
MOST_LEVELS = 12  # a parameter with at most so many values is shown value by value
BINS = 60
MANY, OUTERMOST = 1000, 0.001  # of more runs than these a share at both ends is left out of the bins
LAYERS = 20  # of a parameter
ROUNDING = 1e-9  # of a value: runs that differ by less are alike


class Spread(NamedTuple):
    """Quantiles of a column, and how many runs have no number there."""

    name: str
    least: float
    low: float  # 5 %
    median: float
    high: float  # 95 %
    greatest: float
    missing: int


class Leading(NamedTuple):
    """How a metric goes with a parameter: Spearman's rank correlation, and the share of its ranks' variance.

    The share is that between layers of the parameter: it is also large where the metric first falls and then grows.
    """

    factor: str
    correlation: float
    share: float = 0.0


class Cloud(NamedTuple):
    """How many runs lie where: edges of both axes, and counts."""

    x: Vector
    y: Vector
    counts: Vector


def spread(campaign: Campaign, name: str) -> Spread:
    """Quantiles of a column of numbers."""
    values = campaign.column(name).astype(np.float64)
    return Spread._make((name, *quantiles(values, LEVELS), int(values.size - np.isfinite(values).sum())))


def numeric(campaign: Campaign) -> list[str]:
    """Parameters that are numbers."""
    kinds = campaign.columns.factors
    return [name for name, (kind, _) in kinds.items() if kind in ("double", "int64")]


def leading(campaign: Campaign) -> dict[str, Leading]:
    """For each metric the parameter that it goes with most."""
    return {metric: found[0] for metric, found in correlations(campaign).items() if found[0].correlation}


def correlations(campaign: Campaign) -> dict[str, list[Leading]]:
    """Correlations of each metric with all parameters that are numbers, the largest first."""
    factors, metrics = numeric(campaign), campaign.metrics
    if not factors or campaign.rows < 3:
        return {}
    sample = sample_columns(campaign, [*factors, *metrics])
    known: dict[bytes, list[Vector]] = {}  # ranks of the parameters; most metrics lack the same runs
    found = {}
    for metric in metrics:
        good = np.isfinite(sample[metric])
        of_factors = known.setdefault(good.tobytes(), []) or [ranks(sample[f][good]) for f in factors]
        known[good.tobytes()], own = of_factors, ranks(sample[metric][good])
        values = [Leading(f, correlation(other, own), share(other, own)) for f, other in zip(factors, of_factors)]
        found[metric] = sorted(values, key=lambda one: -abs(one.correlation))
    return found


def sample_columns(campaign: Campaign, names: Sequence[str]) -> dict[str, Vector]:
    """Draw some runs' columns, with a fixed seed."""
    random, part = np.random.default_rng(0), min(1.0, SAMPLED / campaign.rows)
    parts: list[list[Vector]] = []
    for batch in campaign.arrays(*names):
        chosen = random.random(batch[0].size) < part
        parts.append([column[chosen].astype(np.float64) for column in batch])
    return {name: np.concatenate(column) for name, column in zip(names, zip(*parts))}


def ranks(values: Vector) -> Vector:
    """Ranks from 1 on; equal values have the mean of theirs."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[place])


def correlation(x: Vector, y: Vector) -> float:
    """Correlation, of ranks that of Spearman, 0 where one of both does not change."""
    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def share(x: Vector, y: Vector) -> float:
    """Share of the variance of ranks `y` that is between layers of ranks `x`: the correlation ratio, 0 to 1."""
    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0
    count = min(LAYERS, 1 + math.isqrt(x.size) // 2)
    layer = np.minimum((x - 0.5) * count / x.size, count - 1).astype(np.intp)
    runs, off = np.bincount(layer, minlength=count), y - y.mean()
    sums = np.bincount(layer, off, minlength=count)
    return float(np.sum(sums**2 / np.maximum(runs, 1)) / np.sum(off**2))


def levels(campaign: Campaign, name: str) -> list[Any] | None:
    """Values of a parameter in order, None if they are many."""
    found: set[Any] = set()
    for batch in campaign.batches(name):
        found.update(np.unique(batch[name]).tolist())
        if len(found) > MOST_LEVELS:
            return None
    return sorted(found, key=lambda value: (str(type(value)), value))


def group_metric(campaign: Campaign, factor: str, metric: str, values: Sequence[Any]) -> list[tuple[float, ...]]:
    """Quantiles 5, 50 and 95 % of a metric at each of some values of a parameter."""
    given, numbers = zip(*campaign.arrays(factor, metric))
    code, number = np.concatenate(given), np.concatenate(numbers)
    return [quantiles(number[code == value], LEVELS[1:4]) for value in values]


def edges(values: Vector) -> Vector:
    """Edges of bins that hold all values, but of many the outermost thousandths."""
    out = OUTERMOST if values.size > MANY else 0.0
    low, high = quantiles(values, (out, 1.0 - out))
    size = max(abs(low), abs(high))
    if not high - low > ROUNDING * size:  # as one value, which has bins of its own size about it
        low, high = low - 0.5 * (size or 1.0), high + 0.5 * (size or 1.0)
    count = min(BINS, 1 + math.isqrt(values.size))
    return np.linspace(low, high, count + 1) if np.isfinite(low) else np.linspace(0.0, 1.0, count + 1)


def clouds(campaign: Campaign, factors: Sequence[str], metrics: Sequence[str]) -> dict[tuple[str, str], Cloud]:
    """Counts of each parameter and metric, in one go through the runs."""
    if not factors or not metrics:
        return {}
    bins = {name: edges(campaign.column(name).astype(np.float64)) for name in (*factors, *metrics)}
    made = {
        (f, m): Cloud(bins[f], bins[m], np.zeros((bins[f].size - 1, bins[m].size - 1)))
        for f in factors
        for m in metrics
    }
    for batch in campaign.arrays(*factors, *metrics):
        where = {name: places(column, bins[name]) for name, column in zip(bins, batch)}
        for (f, m), cloud in made.items():
            inside, rows = (where[f] >= 0) & (where[m] >= 0), cloud.counts.shape[1]
            flat = np.bincount(where[f][inside] * rows + where[m][inside], minlength=cloud.counts.size)
            cloud.counts[:] += flat.reshape(cloud.counts.shape)
    return made


def places(values: Vector, bins: Vector) -> npt.NDArray[np.intp]:
    """Bin of each value, the last one with its upper edge; -1 for what is outside, or no number."""
    found = np.searchsorted(bins, values, side="right") - 1
    found[values == bins[-1]] = bins.size - 2
    found[found == bins.size - 1] = -1
    return found


def histogram(campaign: Campaign, metric: str) -> tuple[Vector, Vector]:
    """Edges and counts of a metric."""
    values = campaign.column(metric)
    bins = edges(values)
    return bins, np.histogram(values[np.isfinite(values)], bins)[0].astype(np.float64)


class Worst(NamedTuple):
    """A run with its value of a metric; `beyond` is how far it is outside of the bounds, less than 0 inside."""

    run: int
    value: float
    beyond: float


class Extremes(NamedTuple):
    """The worst runs of a metric, and how many are outside of its bounds."""

    worst: tuple[Worst, ...]
    outside: int


def extremes(campaign: Campaign, of: Spread, bounds: Bounds | None, most: int) -> Extremes:
    """The runs farthest beyond the bounds of a metric or nearest to them; without bounds farthest from the median."""
    found, outside = list[Worst](), 0
    if bounds and bounds[0] == 0.0 <= of.least and np.isfinite(bounds[1]):
        bounds = (-np.inf, bounds[1])  # what has no sign is not bad for being small
    for runs, values in campaign.arrays("run", of.name):
        beyond = distance(values.astype(np.float64), of.median, bounds)
        outside += int((beyond > 0.0).sum()) if bounds else 0
        first = np.argpartition(-beyond, most)[:most] if beyond.size > most else range(beyond.size)
        found += [Worst(int(runs[k]), float(values[k]), float(beyond[k])) for k in first if beyond[k] > -np.inf]
    return Extremes(tuple(sorted(found, key=lambda one: (-one.beyond, one.run))[:most]), outside)


def distance(values: Vector, median: float, bounds: Bounds | None) -> Vector:
    """How bad values are; NaN and infinity are left out."""
    found = np.abs(values - median) if bounds is None else np.maximum(bounds[0] - values, values - bounds[1])
    return np.where(np.isfinite(values), found, -np.inf)


def rows(campaign: Campaign, runs: Iterable[int]) -> dict[int, dict[str, Any]]:
    """Parameters and seeds of some runs."""
    wanted, names, found = sorted({*runs}), ("run", "seed", *campaign.factors), dict[int, dict[str, Any]]()
    for batch in campaign.arrays(*names):
        named = np.isin(batch[0], wanted)
        for row in zip(*(column[named].tolist() for column in batch)):
            found[row[0]] = dict(zip(names, row))
    return found
