"""Standard errors and correlations of the identified parameters, from the Jacobian of the residuals.

The textbook formula s^2 (J'J)^-1 takes all residuals for independent.  Here they are not: by (21) and (51) the residual
of the flux linkage is the integral of that of the current, -R times it, so that it weights slow errors and adds no
information; the resistances of (23) come from the same currents; and noise of the voltage, which drives the model,
returns in the current smoothed by L/R.  To first order every estimate is a weighted sum of the residuals of the
current, and the variance of that sum follows from their autocovariance, tapered (Newey and West 1987).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.studies.identification.causes import CAUSES, Matrix
from gapsense.studies.identification.residual import Residual
from gapsense.studies.identification.valve import misfit, model
from gapsense.studies.identification.valve.device import Device
from gapsense.studies.identification.valve.form import FACTOR, SHAPE, Form
from gapsense.studies.identification.valve.many import responses
from gapsense.studies.identification.valve.misfit import Share
from gapsense.studies.identification.valve.model import Experiment, Response
from gapsense.studies.records.flux import trapezoid
from gapsense.studies.records.operations import Operation
from gapsense.studies.records.record import Record, Vector
from gapsense.studies.records.rest import remaining

STEP = 1e-5  # relative change of a parameter for a difference quotient
NEGLIGIBLE = 1e-9  # singular value, relative to the largest, of a combination of parameters without effect


class Uncertainty(NamedTuple):
    """Of the fitted parameters, then of the resistance."""

    relative: Vector  # standard errors, relative to the values; infinite for a parameter without effect
    correlation: Matrix  # of the errors
    shape: Mapping[str, float]  # relative standard errors of the numbers of a gap law, see `Form`
    shares: Mapping[str, Share]  # what each of the causes of `causes` has of the residual


class Influence(NamedTuple):
    """What each residual of an experiment does to each of some numbers."""

    current: Matrix  # (numbers, samples)
    position: Matrix | None  # likewise, where it is fitted


class Doubts(NamedTuple):
    """What else than noise there is."""

    misfits: Sequence[float] = ()  # RMS of what noise does not explain of each experiment [A]
    causes: Mapping[str, float] = {}  # standard errors of their values, which the residual need not show


def uncertainty(
    form: Form, ratios: Vector, experiments: Sequence[Experiment], doubts: Doubts | None = None
) -> Uncertainty:
    """Standard errors at the minimum `ratios` of the cost."""
    n, J, by = ratios.size, jacobian(form, ratios, experiments), misfit.slopes(form, ratios, experiments)
    A = np.linalg.pinv(J, rcond=NEGLIGIBLE).astype(np.float64)
    left = by.residuals - J @ (A @ by.residuals)  # of the causes, by the parameters
    rows = left.T / np.maximum((left**2).sum(axis=0), 1e-300)[:, None]
    weights = _all_weights(form, ratios, experiments, np.vstack([A, rows]))
    models = [responses([form.at(ratios)], e)[0] for e in experiments]
    cov = np.sum([_by_noise(W, e, m) for W, e, m in zip(weights, experiments, models)], axis=0)
    r = np.concatenate([model.weighted(e, m) for e, m in zip(experiments, models)])
    shares = misfit.shares(left, rows, r, np.sqrt(np.diag(cov)[n:-1]))
    of_parameters = [*range(n), -1]
    moved = np.vstack([-A @ by.residuals, by.resistance])
    parts = [W.current[of_parameters] for W in weights]
    cov = cov[np.ix_(of_parameters, of_parameters)] + _beyond_noise(parts, moved, shares, doubts or Doubts())
    lost = _lost(J)
    if FACTOR in form.fitted:  # it is one of the resistance
        cov, lost = _joined(cov, lost, form.fitted.index(FACTOR))
    cov, lost, shape = _without_shape(cov, lost, form)
    std: Vector = np.sqrt(np.diag(cov))
    scale = np.where(std > 0.0, std, 1.0)
    return Uncertainty(np.where(np.append(lost, False), np.inf, std), cov / np.outer(scale, scale), shape, shares)


def _by_noise(W: Influence, experiment: Experiment, at: Response) -> Matrix:
    """Covariance that the residuals of one experiment make."""
    cov = long_run(W.current, experiment.current - at.current)
    if W.position is None or experiment.position is None or at.position is None:
        return cov
    return cov + long_run(W.position, experiment.position - at.position)


def _without_shape(
    cov: Matrix, lost: npt.NDArray[np.bool_], form: Form
) -> tuple[Matrix, npt.NDArray[np.bool_], dict[str, float]]:
    """Covariance without the numbers of the gap law, and the errors of these."""
    names = [name for name in form.fitted if name != FACTOR]
    at = [k for k, name in enumerate(names) if name.startswith(SHAPE)]
    errors = {names[k]: float(np.inf if lost[k] else np.sqrt(cov[k, k])) for k in at}
    return np.delete(np.delete(cov, at, axis=0), at, axis=1), np.delete(lost, at), errors


def doubts(records: Sequence[Record], residuals: Sequence[Residual]) -> Doubts:
    """What the residuals of records have beyond noise, if the model does not explain them, and what rest has hidden."""
    misfits = [0.0 if r.is_explained else np.sqrt(max(r.rms**2 - r.noise**2, 0.0)) for r in residuals]
    signals = {"offset": "current", "shift": "voltage"}
    hidden = [remaining(record) for record in records]
    errors = {cause: [h.get(name, 0.0) for h in hidden] for cause, name in signals.items()}
    return Doubts(misfits, {cause: float(np.sqrt(np.mean(np.square(found)))) for cause, found in errors.items()})


def _beyond_noise(weights: Sequence[Matrix], moved: Matrix, shares: Mapping[str, Share], doubts: Doubts) -> Matrix:
    """Covariance that misfits, causes that the residual shows, and known doubts about causes add."""
    cov = np.zeros((len(moved), len(moved)))
    for W, size in zip(weights, doubts.misfits):
        cov += misfit.spread(W, size) if size else 0.0
    by_cause = dict(zip(CAUSES, moved.T))
    shown = [share.value * by_cause[name] for name, share in shares.items() if share.is_significant]
    for shift in (error * by_cause[name] for name, error in doubts.causes.items()):
        cov += np.outer(shift, shift)
    return cov + misfit.largest([np.outer(shift, shift) for shift in shown]) if shown else cov


def jacobian(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Matrix:
    """Derivatives of the weighted residuals, by central differences."""
    steps = STEP * np.eye(ratios.size)
    points = [form.at(ratios + side * step) for side in (1.0, -1.0) for step in steps]
    found = np.concatenate([[model.weighted(e, m) for m in responses(points, e)] for e in experiments], axis=1)
    return np.asarray((found[: ratios.size] - found[ratios.size :]).T / (2.0 * STEP))


def _lost(J: Matrix) -> npt.NDArray[np.bool_]:
    """Whether a parameter has no effect."""
    _, sizes, directions = np.linalg.svd(J, full_matrices=False)
    return np.asarray(np.abs(directions[sizes <= NEGLIGIBLE * sizes[0]]).max(axis=0, initial=0.0) > 0.1)


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


def _all_weights(form: Form, ratios: Vector, experiments: Sequence[Experiment], A: Matrix) -> list[Influence]:
    """Influence of each residual on what A makes of the weighted residuals, and on the resistance."""
    ends = np.cumsum([e.size for e in experiments])
    parts, total = np.split(A, ends[:-1], axis=1), sum(model.charge(e) for e in experiments)
    return [_weights(form, ratios, e, part, total) for e, part in zip(experiments, parts)]


def _weights(form: Form, ratios: Vector, experiment: Experiment, A: Matrix, total: float) -> Influence:
    """The same of one experiment; the resistance is relative."""
    n = experiment.current.size
    c_i, c_lam = experiment.weights()
    R, half = experiment.resistance, 0.5 * experiment.dt
    later = np.cumsum(A[:, n : 2 * n][:, ::-1], axis=1)[:, ::-1] * R  # of the interval before each sample
    W = -c_i * A[:, :n] + c_lam * half * (later + np.roll(np.where(np.arange(n) > 0, later, 0.0), -1, axis=1))
    pooled, at = np.zeros(n), responses([form.at(ratios)], experiment)[0]
    for operation in experiment.operations:
        share = np.zeros(n)
        share[operation.start + 1 : operation.stop] = 1.0
        share[[operation.start, operation.stop]] = 0.5
        slope = _by_resistance(form.at(ratios), experiment, at, operation)
        W += np.outer(A @ slope, share / trapezoid(experiment.current)[operation.inside].sum())
        pooled -= share / total
    Z = None
    if experiment.position is not None:
        Z = np.vstack([-c_i * experiment.amperes * A[:, 2 * n :], np.zeros(n)])
    return Influence(np.vstack([W, pooled]), Z)


def _by_resistance(par: Device, experiment: Experiment, at: Response, operation: Operation) -> Vector:
    """Slope of the residuals by the logarithm of the resistance of one operation, after which the model is at rest."""
    alone, cut = model.part(experiment, operation), slice(operation.start, operation.stop + 1)

    def changed(factor: float) -> Vector:
        R = experiment.resistance.copy()
        R[operation.inside] *= factor
        (found,) = responses([par], alone._replace(resistance=R[cut]))
        whole = Response(*(_spliced(a, b, cut) for a, b in zip(at, found)))
        return model.weighted(model.with_resistance(experiment, R), whole)

    return (changed(1.0 + STEP) - changed(1.0 - STEP)) / (2.0 * STEP)


def _spliced(whole: Vector | None, piece: Vector | None, at: slice) -> Any:
    """The samples, with a piece in its place."""
    if whole is None:
        return None
    made = whole.copy()
    made[at] = piece
    return made
