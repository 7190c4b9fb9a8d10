"""Multi-directional search (V. Torczon 1989), the method of [UKF] Section III-B: derivative-free, for comparison.

All vertices of a simplex but the best are reflected through the best one; a success is stretched, a failure shrinks the
simplex.  No library that we know has it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.record import Vector

Matrix = npt.NDArray[np.float64]
EXPANSION, CONTRACTION = 2.0, 0.5


class Lowest(NamedTuple):
    """Best point, its value, and how many values were computed."""

    x: Vector
    value: float
    evaluations: int


def search(
    value: Callable[[Vector], float], start: Vector, size: float = 0.1, tolerance: float = 1e-6, limit: int = 5_000
) -> Lowest:
    """Lowest of a function.

    Parameters
    ----------
    value : callable
        Of a point (n,).
    start : (n,) array
        First vertex.
    size : float
        Distance of the other vertices from it, along the axes.
    tolerance : float
        The search ends when no vertex is farther than this from the best one along any axis,
    limit : int
        or when so many values have been computed.
    """
    simplex = np.vstack([start, start + size * np.eye(start.size)])
    values = np.array([value(x) for x in simplex])
    evaluations = values.size

    def trial(center: Vector, others: Matrix, factor: float) -> tuple[Matrix, Vector]:
        nonlocal evaluations
        points = center + factor * (others - center)
        evaluations += len(points)
        return points, np.array([value(x) for x in points])

    while True:
        order = np.argsort(values, kind="stable")
        simplex, values = simplex[order], values[order]
        best, others = simplex[0], simplex[1:]
        if np.abs(others - best).max() <= tolerance or evaluations >= limit:
            return Lowest(best, float(values[0]), evaluations)
        points, found = trial(best, others, -1.0)
        if found.min() < values[0]:
            stretched, beyond = trial(best, others, -EXPANSION)
            points, found = (stretched, beyond) if beyond.min() < found.min() else (points, found)
        else:
            points, found = trial(best, others, CONTRACTION)
        simplex, values = np.vstack([best, points]), np.concatenate([values[:1], found])
