"""The runs of a campaign that somebody will want to look at, found in batches."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from gapsense.campaign.result import Campaign
from gapsense.campaign.summary import Spread

Bounds = tuple[float, float]


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
    if (
        bounds and bounds[0] == 0.0 <= of.least and np.isfinite(bounds[1])
    ):  # what has no sign is not bad for being small
        bounds = (-np.inf, bounds[1])
    for runs, values in campaign.arrays("run", of.name):
        beyond = distance(values.astype(np.float64), of.median, bounds)
        outside += int((beyond > 0.0).sum()) if bounds else 0
        first = np.argpartition(-beyond, most)[:most] if beyond.size > most else range(beyond.size)
        found += [Worst(int(runs[k]), float(values[k]), float(beyond[k])) for k in first if beyond[k] > -np.inf]
    return Extremes(tuple(sorted(found, key=lambda one: (-one.beyond, one.run))[:most]), outside)


def distance(values: npt.NDArray[np.float64], median: float, bounds: Bounds | None) -> npt.NDArray[np.float64]:
    """How bad values are; what is no number is not looked at."""
    found = np.abs(values - median) if bounds is None else np.maximum(bounds[0] - values, values - bounds[1])
    return np.where(np.isfinite(values), found, -np.inf)


def rows(campaign: Campaign, runs: Iterable[int]) -> dict[int, dict[str, Any]]:
    """Parameters and seeds of some runs."""
    wanted, found = pa.array(sorted(set(runs)), pa.int64()), dict[int, dict[str, Any]]()
    for batch in campaign.batches("run", "seed", *campaign.factors):
        for row in batch.filter(pc.is_in(batch["run"], value_set=wanted)).to_pylist():
            found[row["run"]] = row
    return found
