"""Gap law of records with a measured position: current, flux linkage and gap give the reluctance at every sample.

By (49) and (50), i = lambda / N^2 (R_gap(z) + R_iron0 / (1 - |lambda| / lambda_sat)): with a given lambda_sat a sum of
columns whose factors are not negative.  The residual of the current weights each sample by what it tells: without flux
nothing.  Turns are not in it, but for the square that all reluctances have in common.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from gapsense.actuators.magnetics import MU_0, SATURATED
from gapsense.identification.gap_law.laws import Law, Matrix, Vector, basis, lowest, not_negative, reluctance, total
from gapsense.identification.least_squares import square

KNOTS = (2, 3, 4, 6, 8)  # at which slopes are sought
ENOUGH = 6 + 3  # numbers of a law with six of them
FARTHEST = 30.0  # saturation, in the largest flux linkage of the records
WINDOWS = (3.0, 12.0)  # of the fringes at first, in the largest gap
EQUAL = 2.0  # evidence "not worth more than a bare mention" by Kass and Raftery (1995)
KNOWN = "as it is known"
LEAST = 0.01  # of the largest slope
WIDEST = 100.0  # the same, at most


class Measured(NamedTuple):
    """Of all records, from their first operations on."""

    current: Vector  # [A]
    flux_linkage: Vector  # [Wb]
    gap: Vector  # measured [m]


class Trial(NamedTuple):
    """A law, with the core that belongs to it."""

    law: Law  # its offset is that of the gap alone
    core_reluctance: float  # R_iron0 [1/H]
    core_saturation: float  # lambda_sat [Wb]
    size: int  # numbers that were fitted
    left: Vector  # of the current [A]
    scale: float = 1.0  # of the law, where only its form is known


def scale_law(samples: Measured, turns: float, known: Law) -> Trial:
    """A law whose form is known, and its scale alone is not."""
    found, (scale,) = _fit_sum(samples, turns, total(known, samples.gap)[:, None], False)
    return found._replace(law=known._replace(name=KNOWN), size=3, scale=scale)


def trials(samples: Measured, turns: float, upper: float) -> list[Trial]:
    """Laws for gaps up to `upper`, those with the fewest numbers first."""
    linear = _slopes(samples, turns, np.array([0.0]), False)
    knots = [np.linspace(0.0, upper, count) for count in KNOTS]
    return [linear, _fringing(samples, turns, upper, linear), *(_slopes(samples, turns, at, True) for at in knots)]


def evidence(found: list[Trial]) -> list[float]:
    """Criterion of Schwarz for each, the smaller the better; correlated residuals count as fewer."""
    best = min((trial.left for trial in found), key=lambda left: float(left @ left))
    rho = max(0.0, float(best[1:] @ best[:-1] / (best @ best)))
    count = max(2.0, best.size * (1.0 - rho) / (1.0 + rho))
    return [float(count * np.log(trial.left @ trial.left) + trial.size * np.log(count)) for trial in found]


def best(found: list[Trial]) -> Trial:
    """The one that evidence prefers; where the slope is no formula, at as many knots as `ENOUGH` at least.

    The motion tells more of the slope than this regression does, and more knots make nothing less certain.
    """
    worth = evidence(found)
    k = next(k for k, each in enumerate(worth) if each <= min(worth) + EQUAL)
    return max(found[k:], key=lambda trial: min(trial.size, ENOUGH)) if found[k].law.knots else found[k]


def _slopes(samples: Measured, turns: float, knots: Vector, has_offset: bool) -> Trial:
    """Slopes at knots; a single one is the linear law."""
    found, slopes = _fit_sum(samples, turns, basis(knots, samples.gap), has_offset)
    least = LEAST * max(slopes)  # so that a factor can change it
    numbers = tuple(max(slope, least) for slope in slopes)
    name, at = (f"{knots.size} slopes", tuple(knots.tolist())) if has_offset else ("linear", ())
    law = found.law._replace(name=name, numbers=numbers, knots=at)
    return found._replace(law=law, size=len(numbers) + (3 if has_offset else 2))


def _fit_sum(samples: Measured, turns: float, gap: Matrix, has_offset: bool) -> tuple[Trial, list[float]]:
    """Fit the sum of columns of the gap's reluctance, and of the core's with the saturation that suits best.

    The law has no more than its offset; factors of the columns are beside it.
    """
    flux = samples.flux_linkage / turns**2
    others = np.column_stack((*([flux] if has_offset else []), gap * flux[:, None]))

    def fit_factors(logarithm: float) -> tuple[Vector, Vector]:
        core = flux * _saturation(samples.flux_linkage, float(np.exp(logarithm)))
        columns = np.column_stack((core, others))
        factors = not_negative(columns, samples.current)
        return factors, samples.current - columns @ factors

    spans = np.log(np.geomspace(1.0 + 1e-3, FARTHEST, 25) * np.abs(samples.flux_linkage).max())
    at = lowest(lambda x: square(fit_factors(x)[1]), spans)
    factors, left = fit_factors(at)
    core, offset, *rest = factors.tolist() if has_offset else (factors[0], 0.0, *factors[1:])
    law = Law("", float(offset), ())
    return Trial(law, float(core), float(np.exp(at)), 0, left=left), [float(x) for x in rest]


def _fringing(samples: Measured, turns: float, upper: float, linear: Trial) -> Trial:
    """The law of the valve: fringes that belong to the area of its pole."""
    flux, grid = samples.flux_linkage / turns**2, np.linspace(min(0.0, float(samples.gap.min())), 1.2 * upper, 201)

    def law(x: Vector) -> Law:
        r0 = float(np.exp(x[0]))
        return Law("fringing", 0.0, (r0, float(np.sqrt(MU_0 * r0)), float(np.exp(x[1]))))

    def left(x: Vector) -> Vector:
        R = np.interp(samples.gap, grid, reluctance(law(x), grid)[0])
        return np.asarray(samples.current - flux * (R + np.exp(x[2]) * _saturation(samples.flux_linkage, np.exp(x[3]))))

    largest = float(np.abs(samples.flux_linkage).max())
    core, saturation = max(linear.core_reluctance, 1.0), linear.core_saturation
    starts = [np.log([1.3 * linear.law.numbers[0] + 1.0, w * upper, core, saturation]) for w in WINDOWS]
    low = np.log([1e-3, 1.3 * upper, 1e-3 * core, 1.0005 * largest])
    high = np.log([1e20, WIDEST * upper, 1e3 * core, 1.001 * FARTHEST * largest])
    tried = [
        scipy.optimize.least_squares(left, np.clip(x, low, high), bounds=(low - 1e-9, high + 1e-9), x_scale="jac")
        for x in starts
    ]
    x = min(tried, key=lambda each: each.cost).x
    return Trial(
        law=law(x), core_reluctance=float(np.exp(x[2])), core_saturation=float(np.exp(x[3])), size=4, left=left(x)
    )


def _saturation(flux_linkage: Vector, lam_sat: float) -> Vector:
    """Reluctance of the core, relative to that without flux."""
    return np.asarray(1.0 / (1.0 - np.minimum(np.abs(flux_linkage) / lam_sat, SATURATED)))
