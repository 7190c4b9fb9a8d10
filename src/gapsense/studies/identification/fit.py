"""Parameters of a solenoid valve from recorded voltage and current: [UKF] Section III.

The resistance follows from (23), the parameters of a form from the cost (24)-(25); the gap law, the stops, the
relaxed gap of the spring and the gap at the start are known.  The cost has false minima, so that least squares starts
several times, on the first operation of each record; the best start goes on with all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.studies.identification import model
from gapsense.studies.identification.errors import Matrix, Uncertainty, uncertainty
from gapsense.studies.identification.flux import Flux
from gapsense.studies.identification.form import Form
from gapsense.studies.identification.many import currents
from gapsense.studies.identification.model import Experiment, Trajectory, cost
from gapsense.studies.identification.record import Record, Vector, between
from gapsense.studies.identification.residual import Residual, residual
from gapsense.studies.identification.search import search
from gapsense.workers import Progress

SPREAD = 1.5  # random starts lie within this factor of the first one
STEP = 1e-5
LONGEST = 50  # Jacobians per start
POOR = 0.05  # relative standard error from which a parameter counts as not identifiable
SIZES = (0.1, 0.01)  # first steps of the multi-directional search, before and after the charges are balanced


class Start(NamedTuple):
    """Result of the fit of one start to the first operations."""

    ratios: Vector
    cost: float


class Identified(NamedTuple):
    """What was found, and how."""

    parameters: Parameters  # complete set, known ones included
    form: Form  # what was sought
    uncertainty: Uncertainty  # in that order
    cost: float  # J of (24)
    starts: list[Start]  # empty for the multi-directional search
    evaluations: int  # simulations of all records; a shorter one counts in proportion
    fluxes: list[Flux]  # resistances and flux linkage of each record
    models: list[Trajectory]  # what the model does, from the first operation of each record on
    convention: str  # the voltage between samples, see `record.halves`
    residuals: list[Residual]  # of each record
    ratios: Vector  # logarithms, of the fitted parameters to their first guesses

    @property
    def names(self) -> tuple[str, ...]:
        """The fitted parameters, and the resistance."""
        return (*self.form.fitted, "coil_resistance")

    @property
    def is_explained(self) -> bool:
        """Whether the model explains all records."""
        return all(residual.is_explained for residual in self.residuals)

    @property
    def at_bounds(self) -> list[str]:
        """Parameters at a limit of the search."""
        is_there = np.abs(self.ratios) > 0.999 * self.form.bounds
        return [name for name, there in zip(self.form.fitted, is_there) if there]

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
    conventions: Sequence[str] = (),
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
    conventions : sequence of str
        What the voltage between samples may be: the one that fits best is taken.  None: as the records have it.
    """
    form, convention = Form(known), ""
    fit = Fit(form)
    prepared = [model.prepare(record, period) for record in records]
    found = fit.multi_start([model.shortened(e) for e, _ in prepared], starts, seed, progress) if starts else []
    ratios = min(found, key=lambda s: s.cost).ratios if found else form.start
    if conventions:
        convention, ratios = fit.best_convention(records, ratios, conventions, period)
        records = [between(record, convention) for record in records]
        prepared = [model.prepare(record, period) for record in records]
    experiments = [experiment for experiment, _ in prepared]
    for size in SIZES:
        value = partial(fit.cost, experiments=experiments)
        ratios = fit.least_squares(ratios, experiments) if found else search(value, ratios, size).x
        experiments = [model.balanced(form, ratios, e) for e in experiments]
    R = np.average([model.mean_resistance(e) for e in experiments], weights=[model.charge(e) for e in experiments])
    par = form.at(ratios)._replace(coil_resistance=float(R))
    models = [model.simulated(par, e) for e in experiments]
    return Identified(
        parameters=par,
        form=form,
        uncertainty=uncertainty(form, ratios, experiments),
        cost=cost(model.residuals(form, ratios, experiments)),
        starts=found,
        evaluations=round(fit.samples / sum(e.current.size for e in experiments)),
        fluxes=[flux for _, flux in prepared],
        models=models,
        convention=convention,
        residuals=[residual(r, m, flux.operations[0].start) for r, m, (_, flux) in zip(records, models, prepared)],
        ratios=ratios,
    )


class Fit:
    """The minimisation; counts the samples that it simulates."""

    def __init__(self, form: Form) -> None:
        self.form, self.samples = form, 0

    def residuals(self, ratios: Vector, experiments: list[Experiment]) -> Vector:
        """Weighted residuals; values far from any valve give large ones instead of NaN."""
        self.samples += sum(e.current.size for e in experiments)
        return np.nan_to_num(model.residuals(self.form, ratios, experiments), nan=1e3, posinf=1e3, neginf=-1e3)

    def jacobian(self, ratios: Vector, experiments: list[Experiment]) -> Matrix:
        """Derivatives of the residuals: difference quotients of models that are simulated together."""
        steps = np.where(ratios + STEP > self.form.bounds, -STEP, STEP)
        points = [self.form.at(point) for point in (ratios, *(ratios + np.diag(steps)))]
        self.samples += len(points) * sum(e.current.size for e in experiments)
        parts = [[model.weighted(e, current) for current in currents(points, e)] for e in experiments]
        at, *others = np.nan_to_num(np.concatenate(parts, axis=1), nan=1e3, posinf=1e3, neginf=-1e3)
        return np.array([(other - at) / step for other, step in zip(others, steps)]).T

    def cost(self, ratios: Vector, experiments: list[Experiment]) -> float:
        """J of (24)."""
        return cost(self.residuals(ratios, experiments))

    def least_squares(self, ratios: Vector, experiments: list[Experiment]) -> Vector:
        """The minimum next to a point, by a trust region and difference quotients."""
        bounds = (-self.form.bounds, self.form.bounds)
        options = {"bounds": bounds, "x_scale": "jac", "max_nfev": LONGEST}
        found = least_squares(self.residuals, ratios, self.jacobian, args=(experiments,), **options)
        return np.asarray(found.x)

    def best_convention(
        self, records: Sequence[Record], ratios: Vector, conventions: Sequence[str], period: float | None
    ) -> tuple[str, Vector]:
        """The voltage between samples with which the first operations fit best, and the minimum there."""
        found = []
        for convention in conventions:
            prepared = [model.prepare(between(record, convention), period)[0] for record in records]
            first = [model.shortened(e) for e in prepared]
            at = self.least_squares(ratios, first)
            found.append((self.cost(at, first), convention, at))
        _, convention, ratios = min(found, key=lambda entry: entry[0])
        return convention, ratios

    def multi_start(self, experiments: list[Experiment], starts: int, seed: int, progress: Progress) -> list[Start]:
        """Least squares from the first guess and from random points around it."""
        rng, width = np.random.default_rng(seed), np.log(SPREAD)
        found = []
        for k in range(starts):
            progress(k, starts + 1)
            guess = rng.uniform(-width, width, self.form.start.size) if k else self.form.start
            ratios = self.least_squares(guess, experiments)
            found.append(Start(ratios, self.cost(ratios, experiments)))
        progress(starts, starts + 1)
        return found
