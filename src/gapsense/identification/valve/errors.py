"""Standard errors and correlations of the identified parameters, from the Jacobian of the residuals.

The textbook formula s^2 (J'J)^-1 takes all residuals for independent.  Here they are not: by (21) and (51) the residual
of the flux linkage is the integral of that of the current, -R times it, so that it weights slow errors and adds no
information; the resistances of (23) come from the same currents; and noise of the voltage, which drives the model,
returns in the current smoothed by L/R.  To first order every estimate is a weighted sum of the residuals of the
current, and the variance of that sum follows from their autocovariance, tapered (Newey and West 1987).

Where a core stays magnetised, the resistance of an operation is (V - d) / C, with the sum V of its voltage, the sum C
of its current and the flux linkage d that stays afterwards, which the model tells.  So an error of the parameters
returns through the resistances, by a third larger for the valve with hysteresis of a few percent.

The residual cannot tell what the parameters have taken of a cause that the model does not know.  Two things can: how
much of the residual each known cause explains, with the parameters free, and so how far it moves them; and the
correlation that a misfit of the size of the residual would need to move a parameter most.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from gapsense.identification.causes import CAUSES, HIDDEN, Signals, apply_causes
from gapsense.identification.least_squares import Matrix, Vector, differences, long_run
from gapsense.identification.measurements.operations import Operation, trapezoid
from gapsense.identification.measurements.prepare import remaining
from gapsense.identification.residual import Residual
from gapsense.identification.valve.form import FACTOR, SHAPE, Device, Form
from gapsense.identification.valve.minimise import Weighted
from gapsense.identification.valve.model import (
    Experiment,
    Prepared,
    Response,
    balance,
    charge,
    mean_resistance,
    part,
    pooled_resistance,
    residuals,
    simulate_batch,
    weight,
    with_factors,
    with_resistance,
)


def feedback(inverse: Matrix, form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Matrix:
    """What becomes of errors x of what is fitted, first the parameters, in the end: y = x - A B y, with `inverse` A."""
    one = np.eye(len(inverse))
    if FACTOR not in form.fitted:
        return one
    B = np.concatenate([_by_balance(form, ratios, e) for e in experiments])
    one[:, : ratios.size] += inverse @ B
    return np.linalg.inv(one).astype(np.float64)


def _by_balance(form: Form, ratios: Vector, experiment: Experiment) -> Matrix:
    """Derivatives of the weighted residuals by the parameters that only balance the resistances."""
    return differences(
        lambda points: np.array([_balance_and_weigh(form, ratios, others, experiment) for others in points]), ratios
    )


def _balance_and_weigh(form: Form, ratios: Vector, others: Vector, experiment: Experiment) -> Vector:
    """The weighted residuals with the resistances of other parameters."""
    now = balance(form, others, experiment)
    return weight(now, simulate_batch([form.at(ratios)], now)[0])


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


def linearise(
    form: Form, ratios: Vector, experiments: Sequence[Experiment], fitted: Sequence[str], others: Sequence[str]
) -> Linear:
    """The residuals near `ratios`; `fitted` and `others` are names of causes."""
    found = slopes(form, ratios, experiments, [*fitted, *others])
    k = len(fitted)
    J = np.hstack([Weighted(form, experiments).jacobian(ratios), found.residuals[:, :k]])
    A = np.linalg.pinv(J, rcond=NEGLIGIBLE).astype(np.float64)
    return Linear(
        fitted=J,
        inverse=A,
        feedback=feedback(A, form, ratios, experiments),
        resistance=np.append(np.zeros(ratios.size), found.resistance[:k]),
        others=Slopes(found.residuals[:, k:], found.resistance[k:]),
    )


def slopes(form: Form, ratios: Vector, experiments: Sequence[Experiment], names: Sequence[str]) -> Slopes:
    """How causes change the weighted residuals, and the resistance of (23)."""
    at, sizes = left_at(form, ratios, experiments), scales(experiments)
    columns, logarithms = [np.empty((at[0].size, 0))], [np.empty(0)]
    for name in names:
        small = EVERY[name].small
        with_it = left_at(form, ratios, [restore_causes(e, {name: small * sizes[name]}) for e in experiments])
        columns.append(((with_it[0] - at[0]) / small)[:, None])
        logarithms.append(np.array([(with_it[1] - at[1]) / small]))
    return Slopes(np.hstack(columns), np.concatenate(logarithms))


def scales(experiments: Sequence[Experiment]) -> dict[str, float]:
    """What is large of each cause, in its unit."""
    found = [signals(e) for e in experiments]
    return {name: min(cause.scale(s) for s in found) for name, cause in EVERY.items()}


def left_at(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> tuple[Vector, float]:
    """Weighted residuals, and the logarithm of the resistance."""
    return residuals(form, [ratios], experiments)[0], float(np.log(pooled_resistance(experiments)))


def signals(experiment: Experiment) -> Signals:
    """Of an experiment."""
    return Signals(experiment.halves, experiment.current, experiment.dt, mean_resistance(experiment))


def restore_causes(experiment: Experiment, values: dict[str, float]) -> Experiment:
    """The experiment, if the causes have these values: with the resistances that (23) then gives."""
    after = apply_causes(signals(experiment), values)
    new = experiment._replace(halves=after.halves, current=after.current)
    return with_factors(new, [_ratio(new, o.inside) / _ratio(experiment, o.inside) for o in experiment.operations])


def _ratio(experiment: Experiment, inside: slice) -> float:
    return float(experiment.halves[inside].mean(axis=1).sum() / trapezoid(experiment.current)[inside].sum())


class Influence(NamedTuple):
    """What each residual of an experiment does to each of some numbers."""

    current: Matrix  # (numbers, samples)
    position: Matrix | None  # likewise, where it is fitted


def influences(form: Form, ratios: Vector, experiments: Sequence[Experiment], at: Linear) -> list[Influence]:
    """Influence of each residual on what is fitted, on the values of the other causes, and on the resistance."""
    A, ends = np.vstack([at.feedback @ at.inverse, at.rows]), np.cumsum([e.size for e in experiments])
    parts, total = np.split(A, ends[:-1], axis=1), sum(charge(e) for e in experiments)
    found = [_weights(form, ratios, e, part, total) for e, part in zip(experiments, parts)]
    return [_with_causes(W, at.resistance) for W in found]


def _with_causes(W: Influence, by: Vector) -> Influence:
    """The influence with what fitted causes do to the resistance, the last."""
    of_current = np.vstack([W.current[:-1], W.current[-1] + by @ W.current[: by.size]])
    if W.position is None:
        return Influence(of_current, None)
    return Influence(of_current, np.vstack([W.position[:-1], W.position[-1] + by @ W.position[: by.size]]))


def _weights(form: Form, ratios: Vector, experiment: Experiment, A: Matrix, total: float) -> Influence:
    """The same of one experiment; the resistance is relative."""
    n = experiment.current.size
    c_i, c_lam = experiment.weights()
    R, half = experiment.resistance, 0.5 * experiment.dt
    later = np.cumsum(A[:, n : 2 * n][:, ::-1], axis=1)[:, ::-1] * R  # of the interval before each sample
    W = -c_i * A[:, :n] + c_lam * half * (later + np.roll(np.where(np.arange(n) > 0, later, 0.0), -1, axis=1))
    pooled, at = np.zeros(n), simulate_batch([form.at(ratios)], experiment)[0]
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
    alone, cut = part(experiment, operation), slice(operation.start, operation.stop + 1)

    def changed(factor: float) -> Vector:
        R = experiment.resistance.copy()
        R[operation.inside] *= factor
        (found,) = simulate_batch([par], alone._replace(resistance=R[cut]))
        whole = Response(*(_splice(a, b, cut) for a, b in zip(at, found)))
        return weight(with_resistance(experiment, R), whole)

    return differences(lambda points: np.array([changed(1.0 + float(x[0])) for x in points]), np.zeros(1))[:, 0]


def _splice(whole: Vector | None, piece: Vector | None, at: slice) -> Any:
    """The samples, with a piece in its place."""
    if whole is None:
        return None
    made = whole.copy()
    made[at] = piece
    return made


LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # of correlation, in samples
FEW, ALIKE = 0.1, 0.6  # part of the residual that is too little, and what explains nearly as much as another
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


def likely_causes(found: Mapping[str, Share]) -> list[str]:
    """Causes that the residual shows and that can be, the one that explains most of it first."""
    can_be = [name for name, s in found.items() if s.is_significant and s.part > FEW]
    can_be = [name for name in can_be if found[name].value > 0.0 or not CAUSES[name].is_positive]
    most = max((found[name].part for name in can_be), default=0.0)
    near = [name for name in can_be if found[name].part > ALIKE * most]
    return sorted(near, key=lambda name: -found[name].part)


def spread(W: Matrix, size: float) -> Matrix:
    """Covariance of sums of W[:, k] m[k] over a misfit m of this size, with the worst length of correlation for each.

    The correlation falls exponentially.  The covariances of all lengths together tell which sums go together.
    """
    return size**2 * largest([_correlate(W, length) for length in LENGTHS])


def largest(parts: Sequence[Matrix]) -> Matrix:
    """Covariance with the largest variances of several; together they tell the correlations."""
    worst, total = np.max([np.diag(part) for part in parts], axis=0), np.sum(parts, axis=0)
    scale = np.sqrt(worst / np.maximum(np.diag(total), 1e-300))
    return np.asarray(total * np.outer(scale, scale))


def shares_of(at: Linear, residuals: Vector, sizes: Mapping[str, float], errors: Vector) -> dict[str, Share]:
    """Of each cause that is not fitted; `sizes` are their scales, `errors` those of values relative to them."""
    values, total = -at.rows @ residuals, max(float(residuals @ residuals), 1e-300)
    parts = (values**2 * (at.left**2).sum(axis=0) / total).tolist()
    found = zip(sizes.items(), values.tolist(), errors.tolist(), parts)
    return {name: Share(size * x, size * error, part) for (name, size), x, error, part in found if name in CAUSES}


def _correlate(W: Matrix, length: float) -> Matrix:
    """Sum of W[:, k] W[:, j] exp(-|k - j| / length) over all k and j."""
    before = W @ lfilter([1.0], [1.0, -np.exp(-1.0 / length)], W, axis=1).T
    return np.asarray(before + before.T - W @ W.T)


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
    at, k = linearise(form, ratios, experiments, fitted, others), ratios.size
    weights = influences(form, ratios, experiments, at)
    models = [simulate_batch([form.at(ratios)], e)[0] for e in experiments]
    cov = np.sum([_by_noise(W, e, m) for W, e, m in zip(weights, experiments, models)], axis=0)
    r = np.concatenate([weight(e, m) for e, m in zip(experiments, models)])
    n = len(at.fitted.T)
    shares = shares_of(at, r, {name: sizes[name] for name in others}, np.sqrt(np.diag(cov)[n:-1]))
    own = [*range(n), -1]
    parts = [W.current[own] for W in weights]
    moved = dict(zip(others, (at.moved / [sizes[name] for name in others]).T))
    cov = cov[np.ix_(own, own)] + _beyond_noise(parts, moved, shares, doubts)
    if "delay" in fitted:
        cov = cov + _by_sampling(cov, k + fitted.index("delay"))
    return _conclude(cov, at.lost, form, k, {name: sizes[name] for name in fitted}, shares)


def _by_sampling(cov: Matrix, k: int) -> Matrix:
    """What the steps of the model add, by the delay that they make, to all that goes with it."""
    shift = STEPPED * cov[:, k] / cov[k, k]
    return np.outer(shift, shift)


def known_to(form: Form) -> tuple[str, ...]:
    """Causes that the form has itself."""
    return ("eddy",) if "core_eddy" in form.fitted else ()


def _conclude(
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
        cov, lost = _join(cov, lost, form.fitted.index(FACTOR), count)
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
        cov += spread(W, size) if size else 0.0
    shown = [share.value * moved[name] for name, share in shares.items() if share.is_significant]
    for shift in (error * moved[name] for name, error in doubts.causes.items() if name in moved):
        cov += np.outer(shift, shift)
    return cov + largest([np.outer(shift, shift) for shift in shown]) if shown else cov


def _join(cov: Matrix, lost: npt.NDArray[np.bool_], k: int, to: int) -> tuple[Matrix, npt.NDArray[np.bool_]]:
    """Covariance with a fitted factor, at `k`, in the resistance, at `to`."""
    T = np.eye(len(cov))
    T[to, k] = 1.0
    T = np.delete(T, k, axis=0)
    return T @ cov @ T.T, np.delete(lost, k)
