"""Edges of recorded signals, which may come a step earlier or later in another run."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]
SHARE = 0.05  # of the range of a signal: an edge goes beyond it from one row to the next
TYPICAL = 10.0  # median changes from row to row: noise and smooth curves stay below it


def edges(values: Vector) -> Rows:
    """Whether there is an edge between each row and the next: much more than a row usually changes."""
    changes = np.abs(np.diff(values))
    known = changes[np.isfinite(changes)]
    if not known.size:
        return np.zeros(changes.shape, dtype=np.bool_)
    finite = values[np.isfinite(values)]
    least = max(SHARE * float(np.ptp(finite)), TYPICAL * float(np.median(known)))
    found: Rows = changes > least
    return found


def reach(steps: int, step: float, times: Vector) -> int:
    """Rows that so many steps of a component [s] span; at least one, where rows are further apart than steps."""
    if not steps or times.size < 2:
        return 0
    spacing = float(np.median(np.diff(times)))
    return max(1, math.ceil(steps * step / spacing - 1e-6))


def near_edges(values: Vector, rows: int) -> Rows:
    """Rows that an edge of the signal passes if it comes up to so many rows earlier or later."""
    near = np.zeros(values.shape, dtype=np.bool_)
    for k in np.flatnonzero(edges(values)):
        near[max(0, k - rows + 1) : k + rows + 1] = True
    return near


def envelope(values: Vector, rows: int) -> tuple[Vector, Vector]:
    """Least and greatest value of the signal up to so many rows before and after each row."""
    padded = np.pad(values, rows, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * rows + 1)
    return windows.min(axis=1), windows.max(axis=1)


def moved(values: Vector, reference: Vector, allowed: float, rows: int) -> Rows:
    """Rows that differ by no more than an edge that came earlier or later.

    They are near an edge; the value lies between what the reference has up to so many rows away, and the reference
    between what the values have there: so a pulse that is missing, or one too many, is no edge that has moved.
    """
    if not rows or not values.size:
        return np.zeros(values.shape, dtype=np.bool_)
    near = near_edges(values, rows) | near_edges(reference, rows)
    return (
        near
        & between(values, *envelope(reference, rows), allowed)
        & between(reference, *envelope(values, rows), allowed)
    )


def between(values: Vector, low: Vector, high: Vector, allowed: float) -> Rows:
    """Rows at which a signal lies between two others, but for what is allowed; nothing lies between NaN."""
    inside: Rows = (values >= low - allowed) & (values <= high + allowed)
    return inside
