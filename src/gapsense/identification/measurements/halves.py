"""What the voltage was between two samples, which they alone do not tell.

An edge of the drive lies anywhere between two samples: a convention says where.  That of a clamp which lets the current
fall lies where the current has ended, and the current tells it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

CLAMP = 0.1  # of the largest voltage, against the current, from which it is clamped
LINE = 4  # samples of a falling current through which a line is drawn, and of the rest after it
STEPS = np.arange(1.0 - LINE, 1.0)
CLEAR = 8.0  # times by which it falls in a sample more than noise or bend hide


def halves(v: Vector, i: Vector, convention: str) -> Vector:
    """Voltage during the two halves of the interval before each sample (n, 2) [V].

    Of a convention, `trapezoid` takes up to the middle the voltage of the first sample, then that of the second (an
    edge lies half-way on the average); `end` or `start`, that of the sample at the end or the start (held by the
    drive).  Means over the intervals are taken as they are, `end`.
    """
    before = np.concatenate((v[:1], v[:-1]))
    found = np.stack((v if convention == "end" else before, before if convention == "start" else v), axis=1)
    for k, part in ends(v, i):
        shares = np.clip([2.0 * part, 2.0 * part - 1.0], 0.0, 1.0)
        found[k] = v[k] + (v[k - 1] - v[k]) * shares
    return np.asarray(found)


def ends(v: Vector, i: Vector) -> Iterator[tuple[int, float]]:
    """Samples before which a clamp ends with the current, and after which part of the interval it does."""
    sign = float(np.sign(i[int(np.argmax(np.abs(i)))]))
    is_clamped = sign * v < -CLAMP * np.abs(v).max()
    last = np.flatnonzero(is_clamped[LINE - 1 : -LINE] & ~is_clamped[LINE : 1 - LINE]) + LINE
    for k in last.tolist():
        if is_clamped[k - LINE : k].all() and (part := _end(sign * i[k - LINE : k + LINE])) is not None:
            yield k, part


def _end(i: Vector) -> float | None:
    """Where a falling current is zero, after the first half of some samples; None if noise or its bend hides it."""
    before, after = i[:LINE] - np.median(i[LINE:]), i[LINE:]
    slope, last = np.polyfit(STEPS, before, 1)
    hidden = max(float(np.ptp(after)), float(np.ptp(before - slope * STEPS)))
    return min(float(last / -slope), 1.0) if last > 0.0 and -slope > CLEAR * hidden else None
