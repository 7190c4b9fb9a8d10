"""What samples of a signal tell by themselves: noise, steps of a converter, and stretches in which something holds."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

SIGMAS = 4.0
ANYWHERE = 1.0 / math.sqrt(12.0)  # standard deviation of the place of an edge between two samples, in sampling periods
EDGE = 0.25  # of the range of a voltage: less is no edge
NARROW = 100  # samples, over which a convolution is quick; differences of sums round worse


def noise(x: Vector) -> float:
    """Standard deviation of the noise of a signal, from its second differences; jumps do not count."""
    curvature = np.abs(np.diff(x, 2))
    return float(1.4826 * np.median(curvature) / np.sqrt(6.0)) if curvature.size else 0.0


def resolution(x: Vector) -> float:
    """Smallest difference between two values."""
    return float(np.diff(np.unique(x)).min(initial=np.inf))


def hidden(x: Vector) -> float:
    """Standard deviation of what the steps of a converter hide; 0 for a signal that never changes."""
    step = resolution(x)
    return step / float(np.sqrt(12.0)) if np.isfinite(step) else 0.0


def average(x: Vector, width: int) -> Vector:
    """Means over so many neighbouring samples (n - width + 1,); wide ones cost no more than narrow ones."""
    if width <= NARROW:
        return np.convolve(x, np.ones(width) / width, mode="valid")
    sums = np.cumsum(np.concatenate(([0.0], x)))
    return np.asarray((sums[width:] - sums[:-width]) / width)


def true_runs(is_true: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Starts and ends of stretches that are true."""
    change = np.flatnonzero(np.diff(np.concatenate(([0], is_true.astype(int), [0]))))
    return list(zip(change[::2].tolist(), change[1::2].tolist()))


def edges(v: Vector, steep: float) -> list[tuple[int, int]]:
    """The last sample before each edge of a voltage, and that at its end; `steep` is its least step, of the range."""
    size = float(np.ptp(v))
    runs = true_runs(np.abs(np.diff(v)) > max(steep * size, SIGMAS * noise(v)))
    return [(a, b) for a, b in runs if abs(float(v[b] - v[a])) > EDGE * size]
