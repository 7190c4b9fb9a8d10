"""What plots of many runs show: how each metric is distributed, and how it goes with parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.many import summary
from gapsense.many.result import Campaign

Vector = npt.NDArray[np.float64]
POINTS = 2000  # runs that are drawn as points; more are counted
MOST_LABELS = 7  # below an axis


class Bars(NamedTuple):
    """Quantiles 5, 50 and 95 % of a metric, a row for each of the few values of a parameter."""

    names: list[str]
    quantiles: Vector
    places: Vector  # on the axis: the values themselves, or the numbers of texts

    @property
    def labelled(self) -> list[int]:
        """Rows whose names fit below the axis, from the left: a seventh of its length lies between two at least."""
        least = float(np.ptp(self.places)) / MOST_LABELS
        kept: list[int] = []
        for k in np.argsort(self.places, kind="stable").tolist():
            if not kept or self.places[k] - self.places[kept[-1]] >= least:
                kept.append(k)
        return kept


class Distributions:
    """Metrics of a campaign, alone and `over` parameters; many runs are counted, in one go through them.

    The `levels` are the values of each of these parameters, None where they are many.
    """

    def __init__(
        self, campaign: Campaign, over: Mapping[str, Sequence[str]], levels: Mapping[str, list[Any] | None]
    ) -> None:
        self.campaign, self.levels = campaign, levels
        self.is_counted = campaign.rows > POINTS
        self.continuous = list(dict.fromkeys(f for own in over.values() for f in own if levels[f] is None))
        self.clouds = summary.clouds(campaign, self.continuous, list(over)) if self.is_counted else {}

    def alone(self, metric: str) -> tuple[Vector, Vector]:
        """Edges and counts of a histogram."""
        return summary.histogram(self.campaign, metric)

    def over(self, metric: str, factor: str) -> Bars | summary.Cloud | None:
        """A metric over a parameter; None where the runs are few enough to be drawn one by one."""
        if (values := self.levels[factor]) is not None:
            quantiles = np.array(summary.group_metric(self.campaign, factor, metric, values)).reshape(-1, 3)
            return Bars([*map(name_level, values)], quantiles, places_of(values))
        return self.clouds[factor, metric] if self.is_counted else None


def places_of(values: Sequence[Any]) -> Vector:
    """Where values of a parameter stand on an axis: numbers to scale, texts and flags one after the other."""
    is_number = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    return np.array(values, dtype=float) if is_number and len(values) > 1 else np.arange(float(len(values)))


def name_level(value: Any) -> str:
    """Name a value of a parameter that has few."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
