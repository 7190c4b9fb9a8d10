"""What a fit leaves that is no noise, and what that may have done to the parameters.

The residual cannot tell what the parameters have taken of a cause that the model does not know.  Two things can: how
much of the residual each known cause explains, with the parameters free, and so how far it moves them; and the
correlation that a misfit of the size of the residual would need to move a parameter most.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from gapsense.studies.identification.causes import CAUSES, Matrix, Signals, changed
from gapsense.studies.identification.valve.form import Form
from gapsense.studies.identification.valve.many import responses
from gapsense.studies.identification.valve.model import (
    Experiment,
    mean_resistance,
    pooled_resistance,
    weighted,
    with_factors,
)
from gapsense.studies.records.flux import trapezoid
from gapsense.studies.records.record import Vector

LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # of correlation, in samples


SIGNIFICANT = 4.0  # standard errors from which on a cause counts


class Share(NamedTuple):
    """What a cause has of a residual, the parameters being free to follow it."""

    value: float  # that explains most
    error: float  # its standard error
    part: float  # of the squares that it explains

    @property
    def is_significant(self) -> bool:
        """Whether the residual shows it."""
        return abs(self.value) > SIGNIFICANT * self.error


class Slopes(NamedTuple):
    """By the values of all causes."""

    residuals: Matrix  # (residuals, causes)
    resistance: Vector  # of its logarithm (causes,)


def spread(W: Matrix, size: float) -> Matrix:
    """Covariance of sums of W[:, k] m[k] over a misfit m of this size, with the worst length of correlation for each.

    The correlation falls exponentially.  The covariances of all lengths together tell which sums go together.
    """
    return size**2 * largest([_correlated(W, length) for length in LENGTHS])


def largest(parts: Sequence[Matrix]) -> Matrix:
    """Covariance with the largest variances of several; together they tell the correlations."""
    worst, total = np.max([np.diag(part) for part in parts], axis=0), np.sum(parts, axis=0)
    scale = np.sqrt(worst / np.maximum(np.diag(total), 1e-300))
    return np.asarray(total * np.outer(scale, scale))


def shares(left: Matrix, rows: Matrix, residuals: Vector, errors: Vector) -> dict[str, Share]:
    """Of each cause: `left` is what it changes beside the parameters, `rows` gives its value from the residuals."""
    values, total = -rows @ residuals, max(float(residuals @ residuals), 1e-300)
    parts = (values**2 * (left**2).sum(axis=0) / total).tolist()
    return {name: Share(*each) for name, *each in zip(CAUSES, values.tolist(), errors.tolist(), parts)}


def _correlated(W: Matrix, length: float) -> Matrix:
    """Sum of W[:, k] W[:, j] exp(-|k - j| / length) over all k and j."""
    before = W @ lfilter([1.0], [1.0, -np.exp(-1.0 / length)], W, axis=1).T
    return np.asarray(before + before.T - W @ W.T)


def slopes(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Slopes:
    """How the causes change the weighted residuals, and the resistance of (23)."""
    at = _at(form, ratios, experiments)
    columns, logarithms = [], []
    for name, cause in CAUSES.items():
        value = cause.small * min(cause.scale(signals(e)) for e in experiments)
        with_it = _at(form, ratios, [restored(e, {name: value}) for e in experiments])
        columns.append((with_it[0] - at[0]) / value)
        logarithms.append((with_it[1] - at[1]) / value)
    return Slopes(np.array(columns).T, np.array(logarithms))


def _at(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> tuple[Vector, float]:
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
