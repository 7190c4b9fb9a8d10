"""Numbers computed from recorded signals, and whether they lie within their bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


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
    takes_flows: bool = False  # after samples and reference, the efforts at both ends of a bond


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


def residual(effort: Vector, other: Vector, flow: Vector, other_flow: Vector) -> float:
    """Energy that is lost or made on its way through a bond, over what goes through; NaN if nothing does.

    It is the residual energy of Sadjina et al. (2017), of which here the parts of both signs are added.
    """
    leaving, arriving = effort * flow, other * other_flow
    through = 0.5 * np.sum(np.abs(leaving) + np.abs(arriving))
    return float(np.sum(np.abs(leaving - arriving)) / through) if through > 0.0 else math.nan


KINDS: Mapping[str, MetricKind] = {
    "rmse": MetricKind(rms, "required", "Root mean square of the difference"),
    "max_abs": MetricKind(lambda error: float(np.max(np.abs(error))), "optional", "Greatest absolute value"),
    "mean_abs": MetricKind(lambda error: float(np.mean(np.abs(error))), "optional", "Mean absolute value"),
    "mean": MetricKind(lambda error: float(np.mean(error)), "optional", "Mean"),
    "std": MetricKind(lambda error: float(np.std(error)), "optional", "Standard deviation"),
    "final": MetricKind(lambda error: float(error[-1]), "optional", "Last sample"),
    "min": MetricKind(lambda signal: float(np.min(signal)), "optional", "Least sample"),
    "max": MetricKind(lambda signal: float(np.max(signal)), "optional", "Greatest sample"),
    "increase": MetricKind(lambda error: float(error[-1] - error[0]), "optional", "Last sample minus the first"),
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
    "bond": MetricKind(
        residual,
        "axis",
        "Residual energy of a power bond, over the energy that goes through: signal and reference are the efforts at "
        "both ends, `flows` the flows there",
        takes_flows=True,
    ),
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
