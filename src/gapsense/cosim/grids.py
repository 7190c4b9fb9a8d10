"""Two time grids: the rows that are compared, and the value of a signal between its rows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
SLACK = 1e-6  # of the distance of rows: times that are apart by no more are one


def slack(*grids: Vector) -> float:
    """How far apart times of these grids may be and still be one [s]."""
    return SLACK * min((float(np.median(np.diff(g))) for g in grids if g.size > 1), default=0.0)


def are_same(times: Vector, other: Vector) -> bool:
    """True for two grids with the same times."""
    return times.shape == other.shape and bool((np.abs(times - other) <= slack(times, other)).all())


def common(times: Vector, other: Vector, after: float, before: float) -> Vector:
    """Times that are compared [s]: the rows of the coarser grid, as far as both go and within the window."""
    near = slack(times, other)
    low, high = max(times[0], other[0], after) - near, min(times[-1], other[-1], before) + near
    first, second = (grid[(grid >= low) & (grid <= high)] for grid in (times, other))
    chosen: Vector = second if second.size < first.size else first
    return chosen


def sampled(times: Vector, values: Vector, at: Vector) -> Vector:
    """A signal at some times: its row where there is one, else between two rows.

    There it is on a straight line, or, if all its values are whole numbers as modes and switches have, what the
    row before has.
    """
    before = np.clip(np.searchsorted(times, at + slack(times, at), side="right") - 1, 0, times.size - 1)
    is_row = np.abs(times[before] - at) <= slack(times, at)
    finite = values[np.isfinite(values)]
    if (finite == np.round(finite)).all():
        held: Vector = values[before]
        return held
    after = np.minimum(before + 1, times.size - 1)
    width = np.where(after > before, times[after] - times[before], 1.0)
    part = np.clip((at - times[before]) / width, 0.0, 1.0)
    line = values[before] + part * (values[after] - values[before])
    made: Vector = np.where(is_row, values[before], line)
    return made
