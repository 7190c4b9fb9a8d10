"""Standard errors and correlations of the identified parameters, from the Jacobian of the residuals.

The textbook formula s^2 (J'J)^-1 assumes that all residuals are independent. Here they are not. By (21) and (51) the
residual of the flux linkage is -R times the integral of that of the current: it weights slow errors and adds no
information. The resistances of (23) come from the same currents. And noise of the voltage, which drives the model,
returns in the current, smoothed by L/R. To first order every estimate is a weighted sum of the residuals of the
current, and the variance of that sum follows from their autocovariance, tapered (Newey and West 1987).

Where a core stays magnetised, the resistance of an operation is (V - d) / C: V is the sum of its voltage, C that of its
current, and d the flux linkage that stays afterwards by the model. So an error of the parameters returns through the
resistances. It is larger by a third for the valve with hysteresis of a few percent.

A cause that the model lacks may hide in the parameters, and the residual does not show that part. Two things bound it.
One is how much of the residual each known cause explains with the parameters free, and so how far it moves them. The
other is the correlation that a misfit of the size of the residual would need to move a parameter most.

What was given is as certain as `--accuracy` says.  What was assumed may be off by a factor, which is too much for
derivatives. So the fit is repeated with the value one standard error off, to both sides, or as far off as the records
allow. Records say nothing about the stroke, for example, but something about the relaxed gap of a spring, which bends
the motion.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from gapsense.identification.assumptions import scale
from gapsense.identification.causes import (
    ANYWHERE,
    CAUSES,
    HIDDEN,
    PLACE,
    Signals,
    apply_causes,
    cause,
    is_place,
    of_record,
)
from gapsense.identification.least_squares import (
    Matrix,
    Vector,
    differences,
    independent,
    long_run,
    minimise,
    rms,
    square,
)
from gapsense.identification.measurements.operations import Operation, trapezoid
from gapsense.identification.measurements.prepare import hidden_level, remaining
from gapsense.identification.measurements.record import seen_ends
from gapsense.identification.residual import Residual
from gapsense.identification.valve.form import FACTOR, FILTER, SHAPE, Device, Form, multiply, replace_values, value_of
from gapsense.identification.valve.minimise import EXACT, LONGEST, Weighted
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

NEGLIGIBLE = 1e-9  # singular value, relative to the largest, of a combination of parameters without effect
TINY = 1e-300
REACH = (1e-5, 0.1)  # least and most of how far a derivative is taken to each side


class Linear(NamedTuple):
    """By what is fitted, parameters and then causes, and by the causes that are not."""

    fitted: Matrix  # slopes of the residuals (residuals, fitted)
    inverse: Matrix  # what is fitted, from minus the residuals (fitted, residuals)
    believed: Matrix  # likewise, from the believed places of edges, in their deviations (fitted, fitted)
    feedback: Matrix  # what becomes of that by `balance` (fitted, fitted)
    resistance: Vector  # slopes of its logarithm (fitted,)
    others: Matrix  # slopes of the residuals by the causes that are not fitted (residuals, causes)
    of_others: Vector  # slopes of the logarithm of the resistance by these (causes,)

    @property
    def moved(self) -> Matrix:
        """What each of these causes changes: in what is fitted, and in the resistance (fitted and one, causes)."""
        moved = -self.feedback @ (self.inverse @ self.others)
        return np.asarray(np.vstack([moved, self.of_others + self.resistance @ moved]))

    @property
    def left(self) -> Matrix:
        """What they change beside what is fitted (residuals, causes)."""
        return np.asarray(self.others - self.fitted @ (self.inverse @ self.others))

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
    form: Form,
    ratios: Vector,
    experiments: Sequence[Experiment],
    fitted: Sequence[str],
    others: Sequence[str],
    is_wide: bool = False,
) -> Linear:
    """The residuals near `ratios`, or as far around as noise leads; `fitted` and `others` are names of causes."""
    columns, logarithms = slopes(form, ratios, experiments, [*fitted, *others])
    k, problem = len(fitted), Weighted(form, experiments)
    r = problem.residuals([ratios])[0]
    J = problem.jacobian(ratios, r)
    J = np.hstack([problem.secants(ratios, reach(J, r)) if is_wide else J, columns[:, :k]])
    known = np.diag([0.0] * ratios.size + [rms(r) / ANYWHERE * is_place(name) for name in fitted])
    A = np.linalg.pinv(np.vstack([J, known]), rcond=NEGLIGIBLE).astype(np.float64)
    A, believed = A[:, : r.size], A[:, r.size :] @ known * ANYWHERE
    return Linear(
        fitted=J,
        inverse=A,
        believed=believed,
        feedback=feedback(A, form, ratios, experiments),
        resistance=np.append(np.zeros(ratios.size), logarithms[:k]),
        others=columns[:, k:],
        of_others=logarithms[k:],
    )


def slopes(
    form: Form, ratios: Vector, experiments: Sequence[Experiment], names: Sequence[str]
) -> tuple[Matrix, Vector]:
    """How causes, relative to their scales, change the weighted residuals, and the logarithm of the resistance."""
    at, sizes = [residuals(form, [ratios], [e])[0] for e in experiments], scales(experiments, names)
    columns, logarithms = np.empty((sum(r.size for r in at), len(names))), np.empty(len(names))
    before = np.log(pooled_resistance(experiments))
    for k, name in enumerate(names):
        small = cause(name).small
        others = [restore_causes(e, of_record({name: small * sizes[name]}, j)) for j, e in enumerate(experiments)]
        changes = [
            residuals(form, [ratios], [other])[0] - r if other is not e else np.zeros(r.size)
            for other, e, r in zip(others, experiments, at)
        ]
        columns[:, k] = np.concatenate(changes) / small
        logarithms[k] = (np.log(pooled_resistance(others)) - before) / small
    return columns, logarithms


def reach(slopes: Matrix, r: Vector) -> Vector:
    """How far to each side derivatives are taken: so far that the residuals change by as much as the noise of one.

    Where the mover arrives at a sample, slopes jump. With differences to one side only it would arrive later in some
    columns and earlier in others, which would tell parameters apart that no record does.
    """
    return np.asarray(np.clip(rms(r) / np.maximum(np.linalg.norm(slopes, axis=0), TINY), *REACH))


def scales(experiments: Sequence[Experiment], names: Sequence[str]) -> dict[str, float]:
    """A large value of each cause, in its unit."""
    found = [signals(e) for e in experiments]
    return {name: min(cause(name).scale(s) for s in found) for name in names}


def signals(experiment: Experiment) -> Signals:
    """The signals of an experiment that causes change."""
    R = mean_resistance(experiment)
    return Signals(
        halves=experiment.halves, current=experiment.current, dt=experiment.dt, resistance=R, first=experiment.first
    )


def restore_causes(experiment: Experiment, values: dict[str, float]) -> Experiment:
    """The experiment, if the causes have these values: with the resistances that (23) then gives."""
    if not values:
        return experiment
    after = apply_causes(signals(experiment), values)
    new = experiment._replace(halves=after.halves, current=after.current)
    return with_factors(new, [_ratio(new, o.balanced) / _ratio(experiment, o.balanced) for o in experiment.operations])


def _ratio(experiment: Experiment, inside: slice) -> float:
    return float(experiment.halves[inside].mean(axis=1).sum() / trapezoid(experiment.current)[inside].sum())


def feedback(inverse: Matrix, form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Matrix:
    """Matrix from errors x of all that is fitted, parameters first, to what they end as: y = x - A B y, with `inverse`
    A.

    B are derivatives of the weighted residuals where parameters change nothing but the balance of the resistances.
    """
    one, par = np.eye(len(inverse)), form.at(ratios)
    if FACTOR not in form.fitted:
        return one

    def weigh_response(others: Vector, experiment: Experiment) -> Vector:
        now = balance(form, others, experiment)
        return weight(now, simulate_batch([par], now)[0])

    B = [differences(lambda points: np.array([weigh_response(x, e) for x in points]), ratios) for e in experiments]  # noqa: B023
    one[:, : ratios.size] += inverse @ np.concatenate(B)
    return np.linalg.inv(one).astype(np.float64)


def influences(
    form: Form, ratios: Vector, experiments: Sequence[Experiment], at: Linear
) -> list[list[tuple[Matrix, Vector]]]:
    """For the current of each experiment, and its position if fitted: the effect of each residual, and these residuals.

    The effect is on what is fitted, on the values of the other causes and, last, on the logarithm of the resistance.
    """
    A, ends = np.vstack([at.feedback @ at.inverse, at.rows]), np.cumsum([e.size for e in experiments])
    parts, total = np.split(A, ends[:-1], axis=1), sum(charge(e) for e in experiments)
    return [[*_weights(form.at(ratios), e, part, total, at.resistance)] for e, part in zip(experiments, parts)]


def _weights(
    par: Device, experiment: Experiment, A: Matrix, total: float, by: Vector
) -> Iterator[tuple[Matrix, Vector]]:
    """The same of one experiment; the resistance is changed `by` fitted causes too."""
    n = experiment.current.size
    c_i, c_lam = experiment.weights()
    R, half = experiment.resistance, 0.5 * experiment.dt
    later = np.cumsum(A[:, n : 2 * n][:, ::-1], axis=1)[:, ::-1] * R  # of the interval before each sample
    W = -c_i * A[:, :n] + c_lam * half * (later + np.roll(np.where(np.arange(n) > 0, later, 0.0), -1, axis=1))
    pooled, at = np.zeros(n), simulate_batch([par], experiment)[0]
    for operation in experiment.operations:
        share, at_ends = np.zeros(n), [operation.balanced.start - 1, operation.stop]
        share[operation.balanced], share[at_ends] = 1.0, 0.5
        slope = _by_resistance(par, experiment, at, operation)
        W += np.outer(A @ slope, share / trapezoid(experiment.current)[operation.balanced].sum())
        pooled -= share / total
    yield np.vstack([W, pooled + by @ W[: by.size]]), experiment.current - at.current
    if experiment.position is not None and at.position is not None:
        Z = -c_i * experiment.amperes * A[:, 2 * n :]
        yield np.vstack([Z, by @ Z[: by.size]]), experiment.position - at.position


def _by_resistance(par: Device, experiment: Experiment, at: Response, operation: Operation) -> Vector:
    """Slope of the residuals by the logarithm of the resistance of one operation, after which the model is at rest."""
    alone, cut = part(experiment, operation), slice(operation.start, operation.stop + 1)

    def simulate_change(factor: float) -> Vector:
        R, whole = experiment.resistance.copy(), [None if x is None else x.copy() for x in at]
        R[operation.inside] *= factor
        (found,) = simulate_batch([par], alone._replace(resistance=R[cut]))
        for samples, piece in zip(whole, found):
            if samples is not None:
                samples[cut] = piece
        return weight(with_resistance(experiment, R), Response(*whole))  # type: ignore[arg-type]

    return differences(lambda points: np.array([simulate_change(1.0 + float(x[0])) for x in points]), np.zeros(1))[:, 0]


LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # of correlation, in samples
FEW, ALIKE = 0.1, 0.6  # share of the residual that is too little; share of the best cause that is nearly as much
SIGNIFICANT = 4.0  # standard errors from which on a cause counts


class Share(NamedTuple):
    """How much of a residual a cause explains while the parameters are free to follow it."""

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
    parts = list[Matrix]()
    for length in LENGTHS:  # sum of W[:, k] W[:, j] exp(-|k - j| / length) over all k and j
        before = W @ scipy.signal.lfilter([1.0], [1.0, -np.exp(-1.0 / length)], W, axis=1).T
        parts.append(before + before.T - W @ W.T)
    return size**2 * largest(parts)


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


WITHIN = 0.5  # of the growth of the resistance from operation to operation: how well that within one is known
STEPPED = 0.015  # delay that the steps of the model make, of a sample
SPREAD = 0.05  # of a squared sample: variance that its half samples add to a filter of the current
CHANCE = 1.7  # over the root of the samples: residuals over their noise, beyond 1, by chance (two standard deviations)


class Uncertainty(NamedTuple):
    """Of the fitted parameters, then of the resistance, then of the causes that are fitted."""

    relative: Vector  # standard errors of parameters and resistance; infinite for a parameter without effect
    correlation: Matrix  # of the errors of them all
    shape: Mapping[str, float]  # relative standard errors of the numbers of a gap law, see `Form`
    causes: Mapping[str, float]  # standard errors of fitted causes
    shares: Mapping[str, Share]  # share of the residual that each of the other causes explains


class Doubts(NamedTuple):
    """What else than noise there is."""

    misfits: Sequence[float] = ()  # RMS of what noise does not explain of each experiment [A]
    causes: Mapping[str, float] = {}  # standard errors of their values, which the residual need not show
    open: Collection[str] = ()  # causes that may be there: of their values no more is known than the records tell


def uncertainty(
    form: Form,
    ratios: Vector,
    experiments: Sequence[Experiment],
    doubts: Doubts | None = None,
    fitted: Sequence[str] = (),
) -> Uncertainty:
    """Standard errors at the minimum `ratios` of the cost; `fitted` causes have been taken out of the experiments.

    The places of edges are the last of these. Their errors count in those of all else, but are not reported.
    """
    doubts = doubts or Doubts()
    hidden = [n for n, x in doubts.causes.items() if x and n not in fitted and (n in HIDDEN or is_place(n))]
    known = (*fitted, *["eddy"] * ("core_eddy" in form.fitted))
    if all(o.held for e in experiments for o in e.operations):
        known = (*known, "series")  # which cannot be told from the coil's while this is on all the time
    others = [*(c for c in CAUSES if c not in known), *hidden]
    sizes = scales(experiments, [*fitted, *others])
    at = linearise(form, ratios, experiments, fitted, others, is_wide=True)
    found, n = influences(form, ratios, experiments, at), len(at.fitted.T)
    cov = np.sum([long_run(*signal) for signals in found for signal in signals], axis=0)
    r, errors = residuals(form, [ratios], experiments)[0], np.sqrt(np.diag(cov)[n:-1])
    shares = shares_of(at, r, {name: sizes[name] for name in others}, errors)
    own = [*range(n), -1]
    doubts = doubts._replace(causes={**doubts.causes, **{n: shares[n].error for n in doubts.open if n in shares}})
    parts = [of_current[own] for (of_current, _), *_ in found]
    moved = dict(zip(others, (at.moved / [sizes[name] for name in others]).T))
    edges = at.feedback @ at.believed
    edges = np.vstack([edges, at.resistance @ edges])  # what the records do not tell of their places
    cov = cov[np.ix_(own, own)] + _beyond_noise(parts, moved, shares, doubts) + edges @ edges.T
    for k, e in enumerate(experiments):
        for low_pass in e.filtered.others if e.filtered else ():  # one standard error off
            changed = e._replace(filtered=e.filtered and e.filtered._replace(low_pass=low_pass))
            other = residuals(form, [ratios], [*experiments[:k], changed, *experiments[k + 1 :]])[0]
            shift = -at.feedback @ (at.inverse @ (other - r))
            cov = cov + np.outer(shift := np.append(shift, at.resistance @ shift), shift)
    if "delay" in fitted:  # the steps of the model delay too, which adds to everything correlated with it
        k = ratios.size + fitted.index("delay")
        shift = STEPPED * cov[:, k] / cov[k, k]
        cov = cov + np.outer(shift, shift)
    if FILTER in form.fitted:  # likewise
        k, samples = form.fitted.index(FILTER), float(value_of(form.at(ratios), FILTER)) / experiments[0].dt
        shift = min(1.0, 0.5 * SPREAD / samples**2) * cov[:, k] / cov[k, k]
        cov = cov + np.outer(shift, shift)
    return _report(form, fitted, cov, at.lost, sizes, shares)


def _report(
    form: Form,
    fitted: Sequence[str],
    cov: Matrix,
    lost: npt.NDArray[np.bool_],
    sizes: Mapping[str, float],
    shares: Mapping[str, Share],
) -> Uncertainty:
    """Take what is reported from the covariance of all that is fitted; `lost` numbers have no effect."""
    T, causes, kept = select_reported(form, fitted), [n for n in fitted if not is_place(n)], parameters_of(form)
    told = T @ cov @ T.T
    std: Vector = np.sqrt(np.diag(told))
    scale, count = np.where(std > 0.0, std, 1.0), len(kept)
    return Uncertainty(
        relative=np.append(np.where(lost[kept], np.inf, std[:count]), std[count]),
        correlation=told / np.outer(scale, scale),
        shape={
            name: float(np.inf if lost[k] else np.sqrt(cov[k, k]))
            for k, name in enumerate(form.fitted)
            if name.startswith(SHAPE)
        },
        causes={name: float(s * sizes[name]) for name, s in zip(causes, std[count + 1 :])},
        shares=shares,
    )


def select_reported(form: Form, causes: Collection[str] = ()) -> Matrix:
    """Matrix that selects what is reported from what is fitted.

    That is the parameters, then the resistance with the factor on it, then the causes but for the places of edges. The
    numbers of a gap law are reported apart.
    """
    n = len(form.fitted)
    T, told = np.eye(n + len(causes) + 1), sum(not is_place(name) for name in causes)
    T[-1, :n] = [name == FACTOR for name in form.fitted]
    return np.asarray(T[[*parameters_of(form), -1, *range(n, n + told)]])


def parameters_of(form: Form) -> list[int]:
    """Which of what is fitted are parameters of the device."""
    return [k for k, name in enumerate(form.fitted) if name != FACTOR and not name.startswith(SHAPE)]


def doubts(prepared: Prepared, residuals: Sequence[Residual], accuracy: Mapping[str, float]) -> Doubts:
    """What the residuals of records have beyond noise and chance, and what stays hidden.

    `accuracy` has relative standard errors of the scales of voltage and current.
    """
    chances = [1.0 + CHANCE / e.current.size**0.5 for e in prepared.experiments]
    misfits = [np.sqrt(max(r.rms**2 - (by * r.noise) ** 2, 0.0)) for r, by in zip(residuals, chances)]
    signals = {"offset": "current", "shift": "voltage"}
    rest = [remaining(record) for record in prepared.records]
    errors = {cause: rms(np.array([found.get(name, 0.0) for found in rest])) for cause, name in signals.items()}
    known = [WITHIN if flux.warmed.any() else 1.0 for flux in prepared.fluxes]
    changes = [by * np.diff(np.log(flux.resistances)) for by, flux in zip(known, prepared.fluxes)]
    drops = {
        "tail": abs(prepared.drive.get("drop", 0.0)) / sum(len(flux.operations) for flux in prepared.fluxes) ** 0.5
    }
    drift = {"drift": rms(x) if (x := np.concatenate(changes)).size else 0.0}
    carriers = prepared.carriers
    ends = {
        f"{PLACE}{k}.{sample}": error
        for k, r in enumerate([] if any(r.is_mean for r in prepared.records) else prepared.records)
        for sample, _, error in seen_ends(r.voltage, r.current)
    }
    level = rms(np.array([hidden_level(r.voltage, r.current) for r in prepared.records])) / len(rest) ** 0.5
    scales = {**accuracy, "voltage": float(np.hypot(accuracy.get("voltage", 0.0), level))}
    means = {"switched": max(c.doubt for c in carriers), "delay": max(c.late for c in carriers)} if carriers else {}
    return Doubts(misfits, errors | drift | drops | means | ends | scales, {"series"} - {*prepared.drive})


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


STEP = 1e-3  # of a difference quotient
LINEAR = 0.1  # doubt up to which derivatives do
SHOWN = 10.0  # standard errors by one record that a value may be off; then the record shows it, whatever else is wrong
ALLOWED, TRIALS = 0.1, 5  # part by which the cost may grow, and times that a smaller change is tried
OPEN = 1.02  # least relaxed gap, in upper stops, of a spring that opens the valve
GOES_WITH: Mapping[str, Mapping[str, float]] = {  # powers by which fitted values go with held ones, about
    "stop_upper": {
        "coil_turns": 0.5,
        "core_reluctance": 1.0,
        "mover_mass": -2.0,
        "spring_stiffness": -2.0,
        "damping": -2.0,
    },
    "spring_rest": {"spring_stiffness": -1.0},
    "gap_slope": {"coil_turns": 0.5, "core_reluctance": 1.0},
    "gap_area": {"coil_turns": -0.5, "core_reluctance": -1.0},
}


def shift(known: Device, name: str, by: float, tied: Collection[str] = ()) -> Device:
    """The device with another value: e^by times as large, or by that part; `tied` fields go with the stroke."""
    lower, upper = float(value_of(known, "stop_lower")), float(value_of(known, "stop_upper"))
    old = dict(multiply(known, name, float(np.exp(by))))
    if parts := scale(name.replace("_", ".")).parts:
        old = {name: max(0.0, float(value_of(known, name)) + by * (1.0 if parts == "1" else upper - lower))}
    rest, start = (float(value_of(known, field)) for field in ("spring_rest", "initial_position"))
    if name == "spring_rest" and rest > upper:
        old = {name: max(rest * float(np.exp(by)), min(rest, OPEN * upper))}
    if name == "stop_upper":
        old = {name: lower + (upper - lower) * float(np.exp(by))}
        old |= {field: value_of(known, field) * float(np.exp(by)) for field in tied}
    stops = {lower: old.get("stop_lower", lower), upper: old.get("stop_upper", upper)}
    return replace_values(known, **old, initial_position=stops.get(start, start))


def add_doubts(
    p: Weighted, ratios: Vector, found: Uncertainty, doubts: Mapping[str, float], tied: Collection[str] = ()
) -> Uncertainty:
    """The uncertainty at a minimum with what doubts about held fields add, each by itself; see `shift`."""
    if not doubts:
        return found
    moves = [move_by_doubt(p, ratios, name, doubt, tied) for name, doubt in doubts.items()]
    added: Matrix = np.sum([largest([np.outer(x, x) for x in sides]) for sides in moves], axis=0)
    T = select_reported(p.form, found.causes)[:, : ratios.size]
    return widen(found, T @ added @ T.T, {name: float(added[k, k]) for k, name in enumerate(p.form.fitted)})


def move_by_doubt(p: Weighted, ratios: Vector, name: str, doubt: float, tied: Collection[str]) -> list[Vector]:
    """What becomes of the logarithms of what is fitted, if a held value is off to either side."""
    form, one_sided = p.form, bool(scale(name.replace("_", ".")).parts)  # which may be 0, and not less

    def change(by: float) -> Form:
        return form._replace(known=shift(form.known, name, by, tied))

    def residuals(by: float) -> Vector:
        return np.asarray(p._replace(form=change(by)).residuals([ratios])[0])

    def refit(by: float, slopes: Sequence[Vector], before: float) -> Vector:
        """From where slopes lead; where the records do not allow a change, by a smaller one."""
        for _ in range(TRIALS):
            form, ends = change(by), list[tuple[Vector, float]]()
            for start in (ratios + by * slope for slope in slopes):  # around which the bounds are
                law = None if form.law is None else form.law_at(start)
                around = form._replace(known=form.at(start), law=law)
                end = minimise(p._replace(form=around), around.start, LONGEST, EXACT)
                ends.append((start + end.point, square(end.residuals)))
            found, least = min(ends, key=lambda end: end[1])
            grown = least / max(before, TINY) - 1.0
            if grown <= ALLOWED:
                break
            by *= float(np.clip(0.9 * np.sqrt(ALLOWED / grown), 0.1, 0.9))
        return np.asarray(found - ratios)

    J, r = p.jacobian(ratios), residuals(0.0)
    step = doubt if one_sided else STEP
    B = (residuals(step) - (r if one_sided else residuals(-step))) / (step if one_sided else 2.0 * step)
    slope = -np.linalg.pinv(J) @ B
    if not one_sided and doubt <= LINEAR:
        return [doubt * slope]
    alike = np.array([GOES_WITH.get(name, {}).get(fitted, 0.0) for fitted in form.fitted])
    sides = [min(doubt, bound(B + J @ slope, r))] if one_sided else [-doubt, doubt]
    return [refit(by, (slope, alike), square(r)) for by in sides]


def bound(left: Vector, r: Vector) -> float:
    """How far off a value may be by the residuals, of which a change leaves so much."""
    size = max(float(left @ left), TINY)
    return abs(float(left @ r)) / size + SHOWN * float(np.sqrt(square(r) / independent(r) / size))


def widen(found: Uncertainty, added: Matrix, of_shape: Mapping[str, float] = MappingProxyType({})) -> Uncertainty:
    """The uncertainty with a covariance added to that of what is told, and variances to those of a gap law."""
    std = np.array([*found.relative.tolist(), *found.causes.values()])
    sure = np.where(np.isfinite(std), std, 0.0)
    cov = found.correlation * np.outer(sure, sure) + added
    new = np.sqrt(np.diag(cov))
    scaled = np.where(new > 0.0, new, 1.0)
    correlation = np.where(np.isfinite(np.outer(std, std)), cov / np.outer(scaled, scaled), found.correlation)
    shape = {name: float(np.hypot(error, np.sqrt(of_shape.get(name, 0.0)))) for name, error in found.shape.items()}
    return found._replace(
        relative=np.where(np.isfinite(std), new, np.inf)[: found.relative.size], correlation=correlation, shape=shape
    )
