"""Weighted residuals near a minimum: linear in the parameters, and in the causes of `causes`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.causes import CAUSES, HIDDEN, Matrix, Signals, changed
from gapsense.identification.measurements.flux import trapezoid
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.balance import feedback
from gapsense.identification.valve.form import Form
from gapsense.identification.valve.many import responses
from gapsense.identification.valve.model import (
    Experiment,
    mean_resistance,
    pooled_resistance,
    weighted,
    with_factors,
)

STEP = 1e-5  # relative change of a parameter for a difference quotient
NEGLIGIBLE = 1e-9  # singular value, relative to the largest, of a combination of parameters without effect
TINY = 1e-300
EVERY = {**CAUSES, **HIDDEN}


class Slopes(NamedTuple):
    """By the values of causes, each relative to its scale."""

    residuals: Matrix  # (residuals, causes)
    resistance: Vector  # of its logarithm (causes,)


class Linear(NamedTuple):
    """By what is fitted, parameters and then causes, and by the causes that are not."""

    fitted: Matrix  # slopes of the residuals (residuals, fitted)
    inverse: Matrix  # what is fitted, from minus the residuals (fitted, residuals)
    feedback: Matrix  # what becomes of that by `balance` (fitted, fitted)
    resistance: Vector  # slopes of its logarithm (fitted,)
    others: Slopes  # by the causes that are not fitted

    @property
    def moved(self) -> Matrix:
        """What each of these causes changes: in what is fitted, and in the resistance (fitted and one, causes)."""
        moved = -self.feedback @ (self.inverse @ self.others.residuals)
        return np.asarray(np.vstack([moved, self.others.resistance + self.resistance @ moved]))

    @property
    def left(self) -> Matrix:
        """What they change beside what is fitted (residuals, causes)."""
        B = self.others.residuals
        return np.asarray(B - self.fitted @ (self.inverse @ B))

    @property
    def rows(self) -> Matrix:
        """Gives their values from minus the residuals (causes, residuals)."""
        left = self.left
        return np.asarray(left.T / np.maximum((left**2).sum(axis=0), TINY)[:, None])

    @property
    def lost(self) -> npt.NDArray[np.bool_]:
        """Whether what is fitted has no effect."""
        _, sizes, directions = np.linalg.svd(self.fitted, full_matrices=False)
        return np.asarray(np.abs(directions[sizes <= NEGLIGIBLE * sizes[0]]).max(axis=0, initial=0.0) > 0.1)


def linear(
    form: Form, ratios: Vector, experiments: Sequence[Experiment], fitted: Sequence[str], others: Sequence[str]
) -> Linear:
    """The residuals near `ratios`; `fitted` and `others` are names of causes."""
    found = slopes(form, ratios, experiments, [*fitted, *others])
    k = len(fitted)
    J = np.hstack([jacobian(form, ratios, experiments), found.residuals[:, :k]])
    A = np.linalg.pinv(J, rcond=NEGLIGIBLE).astype(np.float64)
    return Linear(
        fitted=J,
        inverse=A,
        feedback=feedback(A, form, ratios, experiments),
        resistance=np.append(np.zeros(ratios.size), found.resistance[:k]),
        others=Slopes(found.residuals[:, k:], found.resistance[k:]),
    )


def jacobian(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Matrix:
    """Derivatives of the weighted residuals, by central differences."""
    steps = STEP * np.eye(ratios.size)
    points = [form.at(ratios + side * step) for side in (1.0, -1.0) for step in steps]
    found = np.concatenate([[weighted(e, m) for m in responses(points, e)] for e in experiments], axis=1)
    return np.asarray((found[: ratios.size] - found[ratios.size :]).T / (2.0 * STEP))


def slopes(form: Form, ratios: Vector, experiments: Sequence[Experiment], names: Sequence[str]) -> Slopes:
    """How causes change the weighted residuals, and the resistance of (23)."""
    at, sizes = left_at(form, ratios, experiments), scales(experiments)
    columns, logarithms = [np.empty((at[0].size, 0))], [np.empty(0)]
    for name in names:
        small = EVERY[name].small
        with_it = left_at(form, ratios, [restored(e, {name: small * sizes[name]}) for e in experiments])
        columns.append(((with_it[0] - at[0]) / small)[:, None])
        logarithms.append(np.array([(with_it[1] - at[1]) / small]))
    return Slopes(np.hstack(columns), np.concatenate(logarithms))


def scales(experiments: Sequence[Experiment]) -> dict[str, float]:
    """What is large of each cause, in its unit."""
    found = [signals(e) for e in experiments]
    return {name: min(cause.scale(s) for s in found) for name, cause in EVERY.items()}


def left_at(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> tuple[Vector, float]:
    """Weighted residuals, and the logarithm of the resistance."""
    r = np.concatenate([weighted(e, responses([form.at(ratios)], e)[0]) for e in experiments])
    return r, float(np.log(pooled_resistance(experiments)))


def signals(experiment: Experiment) -> Signals:
    """Of an experiment."""
    return Signals(experiment.halves, experiment.current, experiment.dt, mean_resistance(experiment))


def restored(experiment: Experiment, values: dict[str, float]) -> Experiment:
    """The experiment, if the causes have these values: with the resistances that (23) then gives."""
    after = changed(signals(experiment), values)
    new = experiment._replace(halves=after.halves, current=after.current)
    return with_factors(new, [_ratio(new, o.inside) / _ratio(experiment, o.inside) for o in experiment.operations])


def _ratio(experiment: Experiment, inside: slice) -> float:
    return float(experiment.halves[inside].mean(axis=1).sum() / trapezoid(experiment.current)[inside].sum())
