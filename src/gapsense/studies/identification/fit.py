"""Parameters of a solenoid valve from recorded voltage and current: [UKF] Section III.

The resistance follows from (23), the six parameters of `FITTED` from the cost (24)-(25); the gap law, the stops, the
relaxed gap of the spring and the gap at the start are known.  The cost has false minima, so that least squares starts
several times, on the first operation of each record; the best start goes on with all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.studies.identification.errors import Uncertainty, uncertainty
from gapsense.studies.identification.flux import Flux
from gapsense.studies.identification.model import (
    FITTED,
    Experiment,
    Trajectory,
    balanced,
    charge,
    cost,
    mean_resistance,
    prepare,
    residuals,
    scaled,
    shortened,
    simulated,
)
from gapsense.studies.identification.record import Record, Vector
from gapsense.studies.identification.search import search

SPREAD = 1.5  # random starts lie within this factor of the first one
BOUND = 5.0  # and the result within this one
SAME = 1.01  # ratio of the costs of starts that found the same minimum
STEP = 1e-5
LONGEST = 50  # Jacobians per start
POOR = 0.05  # relative standard error from which a parameter counts as not identifiable
SIZES = (0.1, 0.01)  # first steps of the multi-directional search, before and after the charges are balanced
Progress = Callable[[int, int], None]


class Start(NamedTuple):
    """Result of the fit of one start to the first operations."""

    ratios: Vector
    cost: float


class Identified(NamedTuple):
    """What was found, and how.

    Attributes
    ----------
    parameters : Parameters
        Complete set, known ones included.
    names : tuple of str
        The six fitted parameters and the resistance.
    uncertainty : Uncertainty
        In that order.
    cost : float
        J of (24).
    starts : list of Start
        Empty for the multi-directional search.
    evaluations : int
        Simulations of all records; a shorter one counts in proportion.
    fluxes : list of Flux
        Resistances and flux linkage of each record.
    models : list of Trajectory
        What the model does, from the first operation of each record on.
    """

    parameters: Parameters
    names: tuple[str, ...]
    uncertainty: Uncertainty
    cost: float
    starts: list[Start]
    evaluations: int
    fluxes: list[Flux]
    models: list[Trajectory]

    @property
    def agreeing(self) -> int:
        """Starts that found the best minimum; the others were rejected by their cost."""
        best = min((s.cost for s in self.starts), default=0.0)
        return sum(s.cost <= SAME * best for s in self.starts)

    @property
    def poor(self) -> list[str]:
        """Parameters that the records do not identify."""
        return [name for name, error in zip(self.names, self.uncertainty.relative) if not error < POOR]


def identify(
    records: Sequence[Record],
    known: Parameters,
    starts: int,
    seed: int = 1,
    period: float | None = None,
    progress: Progress = lambda done, total: None,
) -> Identified:
    """Parameters that fit one or more records best.

    Parameters
    ----------
    records : sequence of Record
        Each begins at rest and has complete periods.
    known : Parameters
        Known parameters, and first guesses of the fitted ones.
    starts : int
        Starts of least squares: the first guess, and random ones.  With 0 the multi-directional search of the paper is
        used instead, from the first guess.
    seed : int
        Of the random starts.
    period : float, optional
        See `operations`.
    progress : callable
        Called with fits done and fits in all.
    """
    prepared = [prepare(record, period) for record in records]
    experiments = [experiment for experiment, _ in prepared]
    fit = Fit(known)
    found = fit.multi_start([shortened(e, 1) for e in experiments], starts, seed, progress) if starts else []
    ratios = min(found, key=lambda s: s.cost).ratios if found else np.zeros(len(FITTED))
    for size in SIZES:
        ratios = fit.least_squares(ratios, experiments) if found else fit.search(ratios, experiments, size)
        experiments = [balanced(known, ratios, e) for e in experiments]
    R = np.average([mean_resistance(e) for e in experiments], weights=[charge(e) for e in experiments])
    par = scaled(known, ratios)._replace(coil_resistance=float(R))
    return Identified(
        parameters=par,
        names=(*FITTED, "coil_resistance"),
        uncertainty=uncertainty(known, ratios, experiments),
        cost=cost(residuals(known, ratios, experiments)),
        starts=found,
        evaluations=round(fit.samples / sum(e.current.size for e in experiments)),
        fluxes=[flux for _, flux in prepared],
        models=[simulated(par, e) for e in experiments],
    )


class Fit:
    """The minimisation; counts the samples that it simulates."""

    def __init__(self, known: Parameters) -> None:
        self.known, self.samples = known, 0

    def residuals(self, ratios: Vector, experiments: list[Experiment]) -> Vector:
        """Weighted residuals; values far from any valve give large ones instead of NaN."""
        self.samples += sum(e.current.size for e in experiments)
        return np.nan_to_num(residuals(self.known, ratios, experiments), nan=1e3, posinf=1e3, neginf=-1e3)

    def least_squares(self, ratios: Vector, experiments: list[Experiment]) -> Vector:
        """The minimum next to a point, by a trust region and difference quotients."""
        bounds = (-np.log(BOUND), np.log(BOUND))
        options = {"bounds": bounds, "diff_step": STEP, "x_scale": "jac", "max_nfev": LONGEST}
        found = least_squares(self.residuals, ratios, args=(experiments,), **options)
        return np.asarray(found.x)

    def multi_start(self, experiments: list[Experiment], starts: int, seed: int, progress: Progress) -> list[Start]:
        """Least squares from the first guess and from random points around it."""
        rng, width = np.random.default_rng(seed), np.log(SPREAD)
        found = []
        for k in range(starts):
            progress(k, starts + 1)
            guess = rng.uniform(-width, width, len(FITTED)) if k else np.zeros(len(FITTED))
            ratios = self.least_squares(guess, experiments)
            found.append(Start(ratios, cost(self.residuals(ratios, experiments))))
        progress(starts, starts + 1)
        return found

    def search(self, ratios: Vector, experiments: list[Experiment], size: float) -> Vector:
        """Multi-directional search from a point on."""
        return search(lambda x: cost(self.residuals(x, experiments)), ratios, size).x
