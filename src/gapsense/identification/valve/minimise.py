"""Least squares of the parameters of a form, from one or several starts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from gapsense.identification.causes import Matrix
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve import model
from gapsense.identification.valve.course import Course
from gapsense.identification.valve.form import Form
from gapsense.identification.valve.many import currents, responses
from gapsense.identification.valve.model import Experiment, cost

SPREAD = 1.5  # random starts lie within this factor of the first one
STEP = 1e-5
LONGEST = 50  # Jacobians per start


class Start(NamedTuple):
    """Result of the fit of one start to the first operations."""

    ratios: Vector
    cost: float  # of these, or of all operations


class Fit:
    """The minimisation; counts the samples that it simulates, and tells them."""

    def __init__(self, form: Form, course: Course | None = None) -> None:
        self.form, self.course, self._samples = form, course or Course(), 0

    @property
    def samples(self) -> int:
        """Simulated so far."""
        return self._samples

    @samples.setter
    def samples(self, count: int) -> None:
        """More have been simulated."""
        self._samples = count
        self.course(count)

    def residuals(self, ratios: Vector, experiments: list[Experiment]) -> Vector:
        """Weighted residuals; values far from any valve give large ones instead of NaN."""
        self.samples += sum(e.current.size for e in experiments)
        par = self.form.at(ratios)
        parts = [model.weighted(e, responses([par], e)[0]) for e in experiments]
        return np.nan_to_num(np.concatenate(parts), nan=1e3, posinf=1e3, neginf=-1e3)

    def jacobian(self, ratios: Vector, experiments: list[Experiment]) -> Matrix:
        """Derivatives of the residuals: difference quotients of models that are simulated together."""
        steps = np.where(ratios + STEP > self.form.bounds, -STEP, STEP)
        points = [self.form.at(point) for point in (ratios, *(ratios + np.diag(steps)))]
        self.samples += len(points) * sum(e.current.size for e in experiments)
        parts = [[model.weighted(e, response) for response in responses(points, e)] for e in experiments]
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

    def balanced(self, ratios: Vector, experiments: list[Experiment]) -> list[Experiment]:
        """The experiments with resistances for which model and measurement have the same charge."""
        par = self.form.at(ratios)
        return [model.balanced(self.form, ratios, e, currents([par], e)[0]) for e in experiments]

    def multi_start(self, experiments: list[Experiment], starts: int, seed: int) -> list[Start]:
        """Least squares from the first guess and from random points around it."""
        rng, width = np.random.default_rng(seed), np.log(SPREAD)
        found = []
        for k in range(starts):
            guess = rng.uniform(-width, width, self.form.start.size) if k else self.form.start
            ratios = self.least_squares(guess, experiments)
            found.append(Start(ratios, self.cost(ratios, experiments)))
        return found
