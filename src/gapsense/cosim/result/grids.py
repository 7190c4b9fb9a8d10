"""Two time grids: the rows that are compared, and the value of a signal between its rows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]
EVEN = 0.1  # share of the rows of an even grid that may be farther apart
SHOWN = 3  # stretches of rows in a message
SLACK = 1e-6  # of the distance of rows: times that are apart by no more are one


def slack(*grids: Vector) -> float:
    """How far apart times of these grids may be and still be one [s]."""
    return SLACK * min((spacing(grid) for grid in grids if (np.diff(grid) > 0.0).any()), default=0.0)


def spacing(times: Vector) -> float:
    """How far rows are apart, in the median [s]; 0 for less than two times."""
    widths = np.diff(times)
    return float(np.median(widths[widths > 0.0])) if (widths > 0.0).any() else 0.0


def are_same(times: Vector, other: Vector) -> bool:
    """True for two grids with the same times."""
    return times.shape == other.shape and bool((np.abs(times - other) <= slack(times, other)).all())


def apart(times: Vector, other: Vector, name: str, other_name: str) -> list[str]:
    """Sentences on rows that only one of two grids has, or that it has twice.

    A grid of which the other has every n-th row is coarser, and nothing is missing in it. Two grids that have little
    in common are only looked through for gaps. Rows beyond the end of the other grid are left to others.
    """
    near = slack(times, other)
    merged = np.sort(np.concatenate((times, other)))
    moments = merged[np.concatenate(([True], np.diff(merged) > near))]
    counts = [np.bincount(places(moments, grid, near), minlength=moments.size) for grid in (times, other)]
    told = []
    for (mine, theirs), of in ((counts, name), (counts[::-1], other_name)):
        twice = mine > np.maximum(theirs, 1)
        if twice.any():
            extra = int((mine - np.maximum(theirs, 1))[twice].sum())
            told.append(f"{of}: {rows(extra)} at times of rows before, {spans(moments, twice)}. Remove what is double.")
    has, rest = (count > 0 for count in counts)
    both, smaller = int((has & rest).sum()), min(int(has.sum()), int(rest.sum()))
    for own, full, of, whose in ((has, rest, name, other_name), (rest, has, other_name, name)):
        if 2 * both > smaller:
            missing = lost(moments, own, full, max(spacing(times), spacing(other)))
            beside = f", which {whose} has"
        else:
            missing, beside = holes(moments, own), ""
        if missing.any():
            said = f"{of}: {rows(int(missing.sum()))} missing{beside}, {spans(moments, missing)}"
            told.append(f"{said}. Run again, or compare a part with `--after` and `--before`.")
    return told


def places(moments: Vector, times: Vector, near: float) -> npt.NDArray[np.int64]:
    """Which of the moments each time is."""
    return np.searchsorted(moments, times + near, side="right") - 1


def lost(moments: Vector, own: Rows, full: Rows, near: float) -> Rows:
    """Moments that only the other grid has, and that are no rows which a coarser grid leaves out."""
    missing = full & ~own
    at = np.flatnonzero(own[full])  # of the other's rows
    if not missing.any() or at.size == 0:
        return missing
    stride = int(np.median(np.diff(at))) if at.size > 1 else 1
    if stride > 1:
        regular = np.zeros(int(full.sum()), dtype=np.bool_)
        regular[at[0] % stride :: stride] = True
        missing[np.flatnonzero(full)[~regular]] = False
    inside = moments[own]
    missing &= (moments > inside[0] - 1.5 * near) & (moments < inside[-1] + 1.5 * near)
    return missing


def holes(moments: Vector, own: Rows) -> Rows:
    """Moments of others at which a grid that is even elsewhere has no row for longer than from row to row."""
    inside = moments[own]
    wide = np.diff(inside) > 1.5 * spacing(inside)
    missing = np.zeros(moments.shape, dtype=np.bool_)
    if 0 < wide.sum() < EVEN * wide.size:
        for k in np.flatnonzero(wide):
            missing |= (moments > inside[k]) & (moments < inside[k + 1]) & ~own
    return missing


def rows(count: int) -> str:
    """So many rows."""
    return f"{count} row is" if count == 1 else f"{count} rows are"


def spans(moments: Vector, chosen: Rows) -> str:
    """Where some of the moments are: the first stretches of them."""
    at = np.flatnonzero(chosen)
    ends = [(int(part[0]), int(part[-1])) for part in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)]
    parts = [
        f"at t = {moments[a]:.9g} s" if a == b else f"from t = {moments[a]:.9g} s to {moments[b]:.9g} s"
        for a, b in ends[:SHOWN]
    ]
    return ", ".join(parts) + (f" and at {len(ends) - SHOWN} more places" if len(ends) > SHOWN else "")


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
