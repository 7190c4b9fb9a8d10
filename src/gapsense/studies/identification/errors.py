"""Standard errors and correlations of the identified parameters, from the Jacobian of the residuals.

The textbook formula s^2 (J'J)^-1 takes all residuals for independent.  Here they are not: by (21) and (51) the residual
of the flux linkage is the integral of that of the current, -R times it, so that it weights slow errors and adds no
information; the resistances of (23) come from the same currents; and noise of the voltage, which drives the model,
returns in the current smoothed by L/R.  To first order every estimate is a weighted sum of the residuals of the
current, and the variance of that sum follows from their autocovariance, tapered (Newey and West 1987).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.studies.identification import model
from gapsense.studies.identification.flux import trapezoid
from gapsense.studies.identification.form import FACTOR, SHAPE, Form
from gapsense.studies.identification.model import Experiment, residuals
from gapsense.studies.identification.record import Vector

Matrix = npt.NDArray[np.float64]
STEP = 1e-5  # relative change of a parameter for a difference quotient
NEGLIGIBLE = 1e-9  # singular value, relative to the largest, of a combination of parameters without effect


class Uncertainty(NamedTuple):
    """Of the fitted parameters, then of the resistance."""

    relative: Vector  # standard errors, relative to the values; infinite for a parameter without effect
    correlation: Matrix  # of the errors
    shape: Mapping[str, float] = {}  # relative standard errors of the numbers of a gap law, see `Form`


def uncertainty(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Uncertainty:
    """Standard errors at the minimum `ratios` of the cost."""
    steps = STEP * np.eye(ratios.size)
    columns = [residuals(form, ratios + s, experiments) - residuals(form, ratios - s, experiments) for s in steps]
    J = np.array(columns).T / (2.0 * STEP)
    _, sizes, directions = np.linalg.svd(J, full_matrices=False)
    lost = np.abs(directions[sizes <= NEGLIGIBLE * sizes[0]]).max(axis=0, initial=0.0) > 0.1
    A = np.linalg.pinv(J, rcond=NEGLIGIBLE).astype(np.float64)
    cov = np.zeros((len(form.fitted) + 1, len(form.fitted) + 1))
    begin, total = 0, sum(model.charge(e) for e in experiments)
    for experiment in experiments:
        n, at = experiment.current.size, model.simulated(form.at(ratios), experiment)
        size = 2 * n if experiment.position is None else 3 * n
        W = _weights(form, ratios, experiment, A[:, begin : begin + size], total)
        cov += long_run(W, experiment.current - at.current)
        if experiment.position is not None:
            W = -experiment.weights()[0] * experiment.amperes * A[:, begin + 2 * n : begin + size]
            cov += long_run(np.vstack((W, np.zeros(n))), experiment.position - at.position)
        begin += size
    if FACTOR in form.fitted:  # it is one of the resistance
        cov, lost = _joined(cov, lost, form.fitted.index(FACTOR))
    cov, lost, shape = _without_shape(cov, lost, form)
    std: Vector = np.sqrt(np.diag(cov))
    scale = np.where(std > 0.0, std, 1.0)
    return Uncertainty(np.where(np.append(lost, False), np.inf, std), cov / np.outer(scale, scale), shape)


def _without_shape(
    cov: Matrix, lost: npt.NDArray[np.bool_], form: Form
) -> tuple[Matrix, npt.NDArray[np.bool_], dict[str, float]]:
    """Covariance without the numbers of the gap law, and the errors of these."""
    names = [name for name in form.fitted if name != FACTOR]
    at = [k for k, name in enumerate(names) if name.startswith(SHAPE)]
    errors = {names[k]: float(np.inf if lost[k] else np.sqrt(cov[k, k])) for k in at}
    return np.delete(np.delete(cov, at, axis=0), at, axis=1), np.delete(lost, at), errors


def _joined(cov: Matrix, lost: npt.NDArray[np.bool_], k: int) -> tuple[Matrix, npt.NDArray[np.bool_]]:
    """Covariance with a fitted factor in the resistance, which is the last."""
    T = np.delete(np.eye(len(cov)), k, axis=0)
    T[-1, k] = 1.0
    return T @ cov @ T.T, np.delete(lost, k)


def long_run(W: Matrix, r: Vector) -> Matrix:
    """Covariance of the sum of W[:, k] r[k] for stationary r, with Bartlett's taper over n^(1/3) lags.

    More lags would see the correlation that the fit itself gives to the residuals, and find too little variance.
    """
    lags = int(np.cbrt(r.size))
    cov = float(r @ r) / r.size * (W @ W.T)
    for h in range(1, lags):
        part = (1.0 - h / lags) * float(r[h:] @ r[:-h]) / r.size * (W[:, h:] @ W[:, :-h].T)
        cov = cov + part + part.T
    return cov


def _weights(form: Form, ratios: Vector, experiment: Experiment, A: Matrix, total: float) -> Matrix:
    """Influence of each residual of the current on the fitted parameters and on the resistance, both relative."""
    n = experiment.current.size
    c_i, c_lam = experiment.weights()
    R, half = experiment.resistance, 0.5 * experiment.dt
    later = np.cumsum(A[:, n : 2 * n][:, ::-1], axis=1)[:, ::-1] * R  # of the interval before each sample
    W = -c_i * A[:, :n] + c_lam * half * (later + np.roll(np.where(np.arange(n) > 0, later, 0.0), -1, axis=1))
    pooled = np.zeros(n)
    for operation in experiment.operations:
        share = np.zeros(n)
        share[operation.start + 1 : operation.stop] = 1.0
        share[[operation.start, operation.stop]] = 0.5
        slope = _by_resistance(form, ratios, experiment, operation.inside)
        W += np.outer(A @ slope, share / trapezoid(experiment.current)[operation.inside].sum())
        pooled -= share / total
    return np.vstack([W, pooled])


def _by_resistance(form: Form, ratios: Vector, experiment: Experiment, inside: slice) -> Vector:
    """Slope of the residuals by the logarithm of the resistance of one operation."""

    def changed(factor: float) -> Vector:
        R = experiment.resistance.copy()
        R[inside] *= factor
        return residuals(form, ratios, [model.with_resistance(experiment, R)])

    return (changed(1.0 + STEP) - changed(1.0 - STEP)) / (2.0 * STEP)
