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

from gapsense.identification.causes import CAUSES, HIDDEN, Matrix
from gapsense.identification.measurements.record import Vector
from gapsense.identification.measurements.rest import remaining
from gapsense.identification.residual import Residual
from gapsense.identification.valve import misfit, model
from gapsense.identification.valve.form import FACTOR, SHAPE, Form
from gapsense.identification.valve.influence import Influence, influences
from gapsense.identification.valve.linear import linear, scales
from gapsense.identification.valve.many import responses
from gapsense.identification.valve.misfit import Share
from gapsense.identification.valve.model import Experiment, Response
from gapsense.identification.valve.prepared import Prepared

STEPPED = 0.015  # delay that the steps of the model make, of a sample


class Uncertainty(NamedTuple):
    """Of the fitted parameters, then of the resistance, then of the causes that are fitted."""

    relative: Vector  # standard errors of parameters and resistance; infinite for a parameter without effect
    correlation: Matrix  # of the errors of them all
    shape: Mapping[str, float]  # relative standard errors of the numbers of a gap law, see `Form`
    causes: Mapping[str, float]  # standard errors of fitted causes
    shares: Mapping[str, Share]  # what each of the other causes has of the residual


class Doubts(NamedTuple):
    """What else than noise there is."""

    misfits: Sequence[float] = ()  # RMS of what noise does not explain of each experiment [A]
    causes: Mapping[str, float] = {}  # standard errors of their values, which the residual need not show


def uncertainty(
    form: Form,
    ratios: Vector,
    experiments: Sequence[Experiment],
    doubts: Doubts | None = None,
    fitted: Sequence[str] = (),
) -> Uncertainty:
    """Standard errors at the minimum `ratios` of the cost; `fitted` causes have been taken out of the experiments."""
    doubts = doubts or Doubts()
    hidden = [name for name in HIDDEN if doubts.causes.get(name)]
    others = [*(c for c in CAUSES if c not in (*fitted, *known_to(form))), *hidden]
    sizes = scales(experiments)
    at, k = linear(form, ratios, experiments, fitted, others), ratios.size
    weights = influences(form, ratios, experiments, at)
    models = [responses([form.at(ratios)], e)[0] for e in experiments]
    cov = np.sum([_by_noise(W, e, m) for W, e, m in zip(weights, experiments, models)], axis=0)
    r = np.concatenate([model.weighted(e, m) for e, m in zip(experiments, models)])
    n = len(at.fitted.T)
    shares = misfit.shares(at, r, {name: sizes[name] for name in others}, np.sqrt(np.diag(cov)[n:-1]))
    own = [*range(n), -1]
    parts = [W.current[own] for W in weights]
    moved = dict(zip(others, (at.moved / [sizes[name] for name in others]).T))
    cov = cov[np.ix_(own, own)] + _beyond_noise(parts, moved, shares, doubts)
    if "delay" in fitted:
        cov = cov + _by_sampling(cov, k + fitted.index("delay"))
    return _told(cov, at.lost, form, k, {name: sizes[name] for name in fitted}, shares)


def _by_sampling(cov: Matrix, k: int) -> Matrix:
    """What the steps of the model add, by the delay that they make, to all that goes with it."""
    shift = STEPPED * cov[:, k] / cov[k, k]
    return np.outer(shift, shift)


def known_to(form: Form) -> tuple[str, ...]:
    """Causes that the form has itself."""
    return ("eddy",) if "core_eddy" in form.fitted else ()


def _told(
    cov: Matrix,
    lost: npt.NDArray[np.bool_],
    form: Form,
    count: int,
    sizes: Mapping[str, float],
    shares: Mapping[str, Share],
) -> Uncertainty:
    """Errors from the covariance of parameters, `count`, fitted causes, and the resistance."""
    order = [*range(count), len(cov) - 1, *range(count, len(cov) - 1)]
    cov, lost = cov[np.ix_(order, order)], np.append(lost, False)[order]
    if FACTOR in form.fitted:  # it is one of the resistance
        cov, lost = _joined(cov, lost, form.fitted.index(FACTOR), count)
    cov, lost, shape = _without_shape(cov, lost, form)
    std: Vector = np.sqrt(np.diag(cov))
    scale, n = np.where(std > 0.0, std, 1.0), std.size - len(sizes)
    causes = {name: float(s * size) for s, (name, size) in zip(std[n:], sizes.items())}
    return Uncertainty(
        relative=np.where(lost, np.inf, std)[:n],
        correlation=cov / np.outer(scale, scale),
        shape=shape,
        causes=causes,
        shares=shares,
    )


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


def doubts(prepared: Prepared, residuals: Sequence[Residual], accuracy: Mapping[str, float]) -> Doubts:
    """What the residuals of records have beyond noise, if the model does not explain them, and what stays hidden.

    `accuracy` has relative standard errors of the scales of voltage and current.
    """
    misfits = [0.0 if r.is_explained else np.sqrt(max(r.rms**2 - r.noise**2, 0.0)) for r in residuals]
    signals = {"offset": "current", "shift": "voltage"}
    rest = [remaining(record) for record in prepared.records]
    errors = {cause: _rms([found.get(name, 0.0) for found in rest]) for cause, name in signals.items()}
    changes = [np.diff(np.log(flux.resistances)) for flux in prepared.fluxes]
    drops = {
        "tail": abs(prepared.drive.get("drop", 0.0)) / sum(len(flux.operations) for flux in prepared.fluxes) ** 0.5
    }
    return Doubts(misfits, errors | {"drift": _rms(np.concatenate(changes))} | drops | {**accuracy})


def _rms(x: Sequence[float] | Vector) -> float:
    return float(np.sqrt(np.mean(np.square(x)))) if len(x) else 0.0


def _beyond_noise(
    weights: Sequence[Matrix], moved: Mapping[str, Vector], shares: Mapping[str, Share], doubts: Doubts
) -> Matrix:
    """Covariance that misfits, causes that the residual shows, and known doubts about causes add.

    `moved` is what each cause does to what is fitted, by its value.
    """
    cov = np.zeros((len(weights[0]), len(weights[0])))
    for W, size in zip(weights, doubts.misfits):
        cov += misfit.spread(W, size) if size else 0.0
    shown = [share.value * moved[name] for name, share in shares.items() if share.is_significant]
    for shift in (error * moved[name] for name, error in doubts.causes.items() if name in moved):
        cov += np.outer(shift, shift)
    return cov + misfit.largest([np.outer(shift, shift) for shift in shown]) if shown else cov


def _joined(cov: Matrix, lost: npt.NDArray[np.bool_], k: int, to: int) -> tuple[Matrix, npt.NDArray[np.bool_]]:
    """Covariance with a fitted factor, at `k`, in the resistance, at `to`."""
    T = np.eye(len(cov))
    T[to, k] = 1.0
    T = np.delete(T, k, axis=0)
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
