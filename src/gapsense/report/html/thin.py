"""Long curves with fewer points for display, which hide no peak."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]
MOST = 4096  # points of a curve
ALL = 400_000  # points of all curves of a result, which is some 4 MB


def most(curves: int) -> int:
    """Points that each of so many curves may have."""
    return max(200, min(MOST, ALL // max(curves, 1)))


def kept(values: Vector, most: int) -> Rows:
    """Rows to show of a curve: all, or else the first, the last, and the least and greatest of each bucket of rows."""
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
