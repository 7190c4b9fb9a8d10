"""Gap laws for measured reluctances, what each leaves over without a gap, and which one is best.

A reluctance that was measured with little flux is the sum of that of the core, which does not depend on the gap, and
that of the gap. The laws are nested: the linear one has a constant slope, and fringing bends it down. Slopes that are
interpolated between a few knots and never negative describe any reluctance that rises with the gap.

The best law predicts best what it has not seen. Each gap between the smallest and the largest is left out once, and
predicted by the law that fits the others. This needs no knowledge of the noise, compares laws of any form, and a law
that follows the noise predicts worse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from gapsense.actuators.magnetics import MU_0, SMALLEST_GAP
from gapsense.identification.least_squares import rms
from gapsense.identification.parameter_set import BEYOND, ROWS

Vector = npt.NDArray[np.float64]
Matrix = npt.NDArray[np.float64]

WINDOW = (2.0, 100.0)  # times the largest gap: below, the fringes end; beyond, the logarithm is a constant
LEAST = 1e-6  # of the reluctance, which the core has at least


class Law(NamedTuple):
    """A gap law, beside a constant reluctance."""

    name: str
    offset: float  # reluctance without gap: that of the core, and what else does not change [1/H]
    numbers: tuple[float, ...]  # slope; slope without fringes, strength, window; slopes at the knots
    knots: tuple[float, ...] = ()  # gaps between which the slope is interpolated [m]


class Family(NamedTuple):
    """Laws of one form."""

    name: str
    size: int  # numbers that are fitted, the offset included
    fit: Callable[[Vector, Vector], Law]  # to gaps [m] and reluctances [1/H], by relative least squares


def reluctance(law: Law, h: Vector) -> tuple[Vector, Vector]:
    """Reluctance of the gap alone [1/H], and its derivative by the gap [1/(H m)]."""
    if law.knots:
        return basis(np.array(law.knots), h) @ law.numbers, np.interp(h, law.knots, law.numbers)
    if len(law.numbers) == 1:
        return law.numbers[0] * h, np.full(h.shape, law.numbers[0])
    return fringing_of(h, *law.numbers)


def fringing_of(h: Vector, r0: float, k: float, window: float) -> tuple[Vector, Vector]:
    """`fringing` of the actuators at several gaps, by NumPy: a fit asks for it ten thousand times."""
    has_fringes = (h > SMALLEST_GAP) & (h < window)
    z = np.where(has_fringes, h, window)
    widening = 1.0 + k * z * np.log(window / z)
    return r0 * h / widening, r0 * np.where(has_fringes, 1.0 + k * z, 1.0) / widening**2


def total(law: Law, h: Vector) -> Vector:
    """Reluctance of gap and core [1/H]."""
    return law.offset + reluctance(law, h)[0]


def rows(law: Law, upper: float) -> dict[str, Vector]:
    """Gap, reluctance and slope from no gap to beyond the largest one, as a table; the offset is in it."""
    h = np.linspace(0.0, BEYOND * upper, ROWS)
    return {"gap": h, "reluctance": total(law, h), "slope": reluctance(law, h)[1]}


def families(most: int, span: tuple[float, float]) -> list[Family]:
    """Laws with at most so many numbers, for gaps of that span [m]; those with the fewest first."""
    found = [
        Family("linear", 2, _linear),
        Family("fringing", 3, partial(_fringing, is_tied=True)),
        Family("free fringing", 4, partial(_fringing, is_tied=False)),
        *(Family(f"{n} slopes", n + 1, partial(_slopes, np.linspace(*span, n))) for n in range(2, most)),
    ]
    return sorted((family for family in found if family.size <= most), key=lambda family: family.size)


def _linear(h: Vector, R: Vector) -> Law:
    offset, slope = _not_negative(np.stack((np.ones_like(h), h), axis=1), R)
    return Law("linear", offset, (slope,))


def _slopes(knots: Vector, h: Vector, R: Vector) -> Law:
    offset, *slopes = _not_negative(np.column_stack((np.ones_like(h), basis(knots, h))), R)
    return Law(f"{len(slopes)} slopes", offset, tuple(slopes), tuple(knots.tolist()))


def _not_negative(columns: Matrix, R: Vector) -> list[float]:
    """Factors of columns, none negative, whose sum is nearest to a reluctance, relatively; the first is never 0."""
    least = LEAST * float(R.min())
    first, *others = not_negative(columns / R[:, None], 1.0 - least / R).tolist()
    return [first + least, *others]


def not_negative(columns: Matrix, values: Vector) -> Vector:
    """Factors of columns, none negative, whose sum is nearest to the values."""
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0.0] = 1.0
    Q, triangle = np.linalg.qr(columns / sizes)
    return np.asarray(scipy.optimize.nnls(triangle, Q.T @ values)[0] / sizes)


def lowest(cost: Callable[[float], float], places: Vector) -> float:
    """Where a cost is lowest: next to the best of some places, which rise."""
    k = int(np.argmin([cost(place) for place in places]))
    bounds = places[max(k - 1, 0)], places[min(k + 1, places.size - 1)]
    return float(scipy.optimize.minimize_scalar(cost, bounds=bounds, method="bounded").x)


def basis(knots: Vector, h: Vector) -> Matrix:
    """Integrals from 0 to `h` of the slopes that are 1 at one knot and 0 at all others; constant beyond the last."""
    points = np.unique(np.concatenate((knots, h, [0.0])))
    heights = np.stack([np.interp(points, knots, row) for row in np.eye(knots.size)], axis=1)
    areas = 0.5 * (heights[1:] + heights[:-1]) * np.diff(points)[:, None]
    sums = np.vstack((np.zeros(knots.size), np.cumsum(areas, axis=0)))
    return np.asarray(sums[np.searchsorted(points, h)] - sums[np.searchsorted(points, 0.0)])


def _fringing(h: Vector, R: Vector, is_tied: bool) -> Law:
    """Fringing, with the strength that belongs to the area of the pole (`is_tied`) or one of its own."""
    start, largest = _linear(h, R), float(h.max())
    slope = start.numbers[0] or float(R.max()) / largest

    def law(x: Vector) -> Law:
        r0, bend, offset = np.exp(x[0]), np.exp(x[1]), np.exp(x[2])
        k = math.sqrt(MU_0 * r0) if is_tied else np.exp(x[3])
        return Law("fringing" if is_tied else "free fringing", float(offset), (float(r0), float(k), float(bend)))

    def residuals(x: Vector) -> Vector:
        return np.asarray(total(law(x), h) / R - 1.0)

    tried = [
        [factor * slope, window * largest, max(start.offset, 0.01 * float(R.min())), 1.0 / largest]
        for factor in (1.2, 3.0)
        for window in (3.0, 30.0)
    ]
    least = [1e-3 * slope, WINDOW[0] * largest, LEAST * float(R.min()), 1e-4 / largest]
    most = [1e3 * slope, WINDOW[1] * largest, 2.0 * float(R.max()), 1e3 / largest]
    bounds = [np.log(limits[: 3 if is_tied else 4]) for limits in (least, most)]
    starts = [np.clip(np.log(x[: bounds[0].size]), bounds[0] + 1e-6, bounds[1] - 1e-6) for x in tried]
    found = [scipy.optimize.least_squares(residuals, x, bounds=bounds) for x in starts]
    return law(min(found, key=lambda each: each.cost).x)


FEWEST = 3  # gaps
MOST = 8  # numbers of a law
AS_GOOD = 1.15  # ratio of two errors that are called equal
FINE = 1e-3  # relative error that needs no finer law


class Candidate(NamedTuple):
    """A law, how well it fits, and how well it foretells."""

    law: Law
    size: int  # numbers fitted
    misfit: float  # RMS, relative
    foretold: float  # the same of gaps that were left out
    others: list[Law]  # without each gap in turn


def candidates(h: Vector, R: Vector) -> list[Candidate]:
    """All laws that so many points can tell, fitted to gaps [m] and reluctances [1/H]."""
    span, count = (float(h.min()), float(h.max())), np.unique(h).size
    return [candidate(family, h, R) for family in families(min(MOST, max(count - 1, 2)), span)]


def candidate(family: Family, h: Vector, R: Vector) -> Candidate:
    """A law of a family, judged."""
    law, gaps, errors, others = family.fit(h, R), np.unique(h), list[Vector](), list[Law]()
    for gap in gaps:
        left_out = h == gap
        others.append(family.fit(h[~left_out], R[~left_out]))
        if gaps[0] < gap < gaps[-1]:
            errors.append(total(others[-1], h[left_out]) / R[left_out] - 1.0)
    return Candidate(
        law=law,
        size=family.size,
        misfit=rms(total(law, h) / R - 1.0),
        foretold=rms(np.concatenate(errors)),
        others=others,
    )


def best_law(found: list[Candidate]) -> Candidate:
    """Of the laws that predict as well as any, the one with the fewest numbers."""
    limit = max(FINE, AS_GOOD * min(each.foretold for each in found))
    return min((each for each in found if each.foretold <= limit), key=lambda each: (each.size, each.foretold))


def jackknife(values: Vector) -> Vector:
    """Standard errors of what follows from all gaps, from what follows without each of them in turn (gaps, values)."""
    n = len(values)
    return np.asarray(np.sqrt((n - 1) / n * ((values - values.mean(axis=0)) ** 2).sum(axis=0)))
