"""Least squares of a form from one or several starts, and which form and which reading of the voltage records call for.

From the plain form on, each of what may be added is tried in turn, and the one with most evidence is taken, until none
has enough.  Losses may hide in the noise and yet bias all else, so that they are tried where only noise is left, too.
The evidence is the difference of the Bayesian information criteria,

    n ln(S_before / S_after) - k ln n,

with sums S of the squared residuals of the current, k more parameters, and as many independent samples n as the
autocorrelation of what is left afterwards tells.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.identification.least_squares import (
    Asked,
    Matrix,
    Minimum,
    descend,
    differences,
    independent,
    minimise,
    quotients,
    square,
    steps_within,
)
from gapsense.identification.measurements.record import Vector
from gapsense.identification.residual import is_small
from gapsense.identification.valve.form import FACTOR, FILTER, FITTED, Form, Sought, larger
from gapsense.identification.valve.model import Experiment, First, balance, residuals, residuals_of, simulate_currents


class Course:
    """Counts samples that are simulated; what a phase took less or more than was expected of it changes the end."""

    def __init__(self, progress: Progress, phases: Mapping[str, float], samples: int) -> None:
        self.progress, self.phases, self.samples = progress, {**phases}, samples
        self.done, self.since = 0, 0  # samples simulated, and when the phase began

    def __call__(self, simulated: int) -> None:
        """So many samples have been simulated by now."""
        self.done = simulated
        self._tell()

    def begins(self, phase: str) -> None:
        """The phases before this one are over."""
        for name in list(self.phases):
            if name == phase:
                break
            self.phases.pop(name)
        self.since = self.done
        self._tell()

    def _tell(self) -> None:
        used = self.done - self.since
        now, *later = self.phases.values()
        left = max(now - used, 0.1 * now) + sum(later)
        self.progress(round(self.done / self.samples), round((self.done + left) / self.samples) + 1)


SPREAD = 1.5  # random starts lie within this factor of the first one
LONGEST = 50  # steps per start
EXACT, NEAR = 1e-8, 1e-4  # part of the cost: less ends a search, or that of a start among others


class Start(NamedTuple):
    """Result of the fit of one start to the first operations."""

    ratios: Vector
    cost: float  # of these, or of all operations


class Weighted(NamedTuple):
    """The problem of [UKF] (24)-(25) for some experiments: a point is the logarithms of a form's ratios."""

    form: Form
    experiments: Sequence[Experiment]
    simulated: Callable[[int], None] = lambda samples: None  # called with the samples that were simulated
    scale: Vector | None = None  # of steps, see `least_squares`

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Lowest and highest point."""
        return self.form.limits

    def residuals(self, points: Sequence[Vector]) -> Matrix:
        """Weighted ones (points, residuals)."""
        self.simulated(len(points) * sum(e.current.size for e in self.experiments))
        return residuals(self.form, points, self.experiments)

    def jacobian(self, point: Vector, at: Vector | None = None, /) -> Matrix:
        """Their derivatives."""
        return differences(self.residuals, point, self.form.limits[1], at)

    def secants(self, point: Vector, steps: Vector) -> Matrix:
        """The same as mean slopes over these steps to both sides."""
        after, before = np.split(self.residuals([*(point + np.diag(steps)), *(point - np.diag(steps))]), 2)
        return np.asarray((after - before).T / (2.0 * steps))


def minimise_together(problems: Sequence[Weighted], starts: Sequence[Vector], enough: float) -> list[Minimum]:
    """The minima of several problems: the same as one by one, but what they ask for at a time is simulated at once."""
    searches = [descend(p, start, LONGEST, enough) for p, start in zip(problems, starts)]
    ends, answers = dict[int, Minimum](), dict[int, Matrix]()
    while len(ends) < len(problems):
        asked = dict[int, Asked]()
        for k, search in enumerate(searches):
            try:
                asked |= {} if k in ends else {k: search.send(answers.get(k))}
            except StopIteration as end:
                ends[k] = end.value
        answers = _answer(problems, asked)
    return [ends[k] for k in range(len(problems))]


def _answer(problems: Sequence[Weighted], asked: Mapping[int, Asked]) -> dict[int, Matrix]:
    """Residuals or derivatives for each problem; those with the same model and experiments are one simulation."""
    groups, steps = dict[Any, dict[int, list[Vector]]](), dict[int, Vector]()
    for k, (points, known) in asked.items():
        p = problems[k]
        if known is not None:
            steps[k] = steps_within(points[0], p.form.limits[1])
            points = [*(points[0] + np.diag(steps[k]))]
        kind = type(p.form.known), FILTER in p.form.fitted, id(p.experiments)
        groups.setdefault(kind, {})[k] = points
    found = dict[int, Matrix]()
    for group in groups.values():
        p = problems[next(iter(group))]
        pars = [par for k, points in group.items() for par in map(problems[k].form.at, points)]
        p.simulated(len(pars) * sum(e.current.size for e in p.experiments))
        # What hysteresis saturates takes 20 times as long and holds up all of its vector: side by side these are fewer
        places = np.argsort([-getattr(par, "core_hysteresis", 0.0) for par in pars], kind="stable")
        made = residuals_of([pars[k] for k in places], p.experiments)[np.argsort(places)]
        found |= zip(group, np.split(made, np.cumsum([*map(len, group.values())])[:-1]))
    return {k: r if (at := asked[k][1]) is None else quotients(at, r, steps[k]) for k, r in found.items()}


class Fit:
    """The minimisation; counts the samples that it simulates, and tells them."""

    def __init__(self, form: Form, course: Course | None = None) -> None:
        self.form, self.samples = form, 0  # simulated so far
        self.course = course or Course(lambda done, total: None, {"": 0.0}, 1)

    def count(self, samples: int) -> None:
        """More have been simulated."""
        self.samples += samples
        self.course(self.samples)

    def cost(self, ratios: Vector, experiments: Sequence[Experiment]) -> float:
        """J of (24)."""
        return square(Weighted(self.form, experiments, self.count).residuals([ratios])[0])

    def least_squares(self, ratios: Vector, experiments: Sequence[Experiment], enough: float = EXACT) -> Vector:
        """The minimum next to a point, or the way there until a step lowers the cost by that part only."""
        return minimise(Weighted(self.form, experiments, self.count), ratios, LONGEST, enough).point

    def balance_experiments(self, ratios: Vector, experiments: list[Experiment]) -> list[Experiment]:
        """Balance the experiments: resistances for which model and measurement have the same charge."""
        par = self.form.at(ratios)
        return [balance(self.form, ratios, e, simulate_currents([par], e)[0]) for e in experiments]

    def multi_start(self, experiments: list[Experiment], starts: int, seed: int) -> list[Start]:
        """Least squares from the first guess and from random points around it."""
        rng, width, start = np.random.default_rng(seed), np.log(SPREAD), self.form.start
        guesses = [rng.uniform(-width, width, start.size) if k else start for k in range(starts)]
        ends = minimise_together([Weighted(self.form, experiments, self.count)] * starts, guesses, EXACT)
        return [Start(end.point, square(end.residuals)) for end in ends]


ENOUGH = 6.0  # evidence from which a form is taken: "strong" by Kass and Raftery (1995)


class Trial(NamedTuple):
    """A form that was fitted to the first operations."""

    form: Form
    ratios: Vector
    cost: float  # J of (24)
    errors: list[Vector]  # of the current [A]
    evidence: float = 0.0  # for it, against the form before
    is_taken: bool = True

    @property
    def rms(self) -> float:
        """What it leaves of the current [A]."""
        return float(np.sqrt(np.mean(np.concatenate(self.errors) ** 2)))


def choose_form(fit: Fit, ratios: Vector, firsts: Sequence[First], sought: Sought) -> list[Trial]:
    """Every form that was tried; the last one that is taken is to be used."""
    best = try_form(fit, ratios, firsts)
    tried = [best]
    while not is_quiet(best, firsts) and (forms := larger(best.form, sought)):
        found = try_larger(fit, forms, best, firsts)
        found.sort(key=lambda trial: trial.evidence)
        if found[-1].evidence < ENOUGH:
            return [*tried, *found]
        best = found[-1]._replace(is_taken=True)
        tried += [*found[:-1], best]
    return tried


def is_quiet(trial: Trial, firsts: Sequence[First]) -> bool:
    """Whether less is left than sampling alone leaves: then nothing can be told."""
    return all(is_small(error, first.record, first.start) for error, first in zip(trial.errors, firsts))


def try_larger(fit: Fit, forms: Sequence[Form], before: Trial, firsts: Sequence[First]) -> list[Trial]:
    """The larger forms, fitted from the smaller one on, and from the first guess of what was added, or of all."""
    same = {FACTOR in form.fitted: [first.of(form) for first in firsts] for form in forms}
    problems = [Weighted(form, same[FACTOR in form.fitted], fit.count) for form in forms]
    tried = [(p, start) for p in problems for start in _starts(before, p.form)]
    near = minimise_together([p for p, _ in tried], [start for _, start in tried], NEAR)
    ends = [[end for (one, _), end in zip(tried, near) if one is p] for p in problems]
    best = [min(found, key=lambda end: square(end.residuals)).point for found in ends]
    left, made = relative(before.errors, firsts), list[Trial]()
    for p, end in zip(problems, minimise_together(problems, best, EXACT)):
        errors = currents_left(p.form, end.point, p.experiments)
        more = len({*p.form.fitted} - {*before.form.fitted})
        found = evidence(left, relative(errors, firsts), more)
        made.append(Trial(p.form, end.point, square(end.residuals), errors, evidence=found, is_taken=False))
    return made


def _starts(before: Trial, form: Form) -> list[Vector]:
    """Where the fit of a larger form begins; where nothing was added before, two of these are the same."""
    start = carry_over(before.form, before.ratios, form)
    starts = (start, np.where(np.isin(form.fitted, FITTED), start, 0.0), form.start)
    return [np.array(each) for each in dict.fromkeys(map(tuple, starts))]


def try_form(fit: Fit, ratios: Vector, firsts: Sequence[First]) -> Trial:
    """A form as it is fitted."""
    experiments = [first.of(fit.form) for first in firsts]
    return Trial(fit.form, ratios, fit.cost(ratios, experiments), currents_left(fit.form, ratios, experiments))


def currents_left(form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> list[Vector]:
    """What the model leaves of the current of each experiment [A]."""
    par = form.at(ratios)
    return [e.current - simulate_currents([par], e)[0] for e in experiments]


def relative(errors: Sequence[Vector], firsts: Sequence[First]) -> Vector:
    """Errors of all records, relative to their weights."""
    return np.concatenate([error * first.experiment.weights()[0] for error, first in zip(errors, firsts)])


def carry_over(form: Form, ratios: Vector, to: Form) -> Vector:
    """Ratios of another form, as far as it seeks the same."""
    at = dict(zip(form.fitted, ratios.tolist()))
    at |= {"gap_area": -at["gap_slope"]} if "gap_slope" in at else {}
    return np.array([at.get(name, 0.0) for name in to.fitted])


def evidence(before: Vector, after: Vector, more: int) -> float:
    """For a form with `more` parameters, from what is left before and after."""
    n = independent(after)
    return n * float(np.log((before @ before) / (after @ after))) - more * float(np.log(n))


def best_reading(fit: Fit, ratios: Vector, readings: Sequence[list[First]], sought: Sought) -> tuple[int, Vector]:
    """The reading with which the first operations fit best, by its place, and the minimum there.

    Eddy currents too act where the voltage jumps, and the best reading without them may be a wrong one: each is tried
    with the first of the larger forms.
    """
    starts = [fit.least_squares(ratios, [first.experiment for first in firsts]) for firsts in readings]
    found = [try_form(fit, start, firsts) for start, firsts in zip(starts, readings)]
    best = int(np.argmin([t.cost for t in found]))
    forms = larger(fit.form, sought)
    if forms and not is_quiet(found[best], readings[best]):
        others = [try_larger(fit, forms[:1], t, firsts)[0] for t, firsts in zip(found, readings)]
        best = int(np.argmin([t.cost for t in others]))
    return best, found[best].ratios


EXPANSION, CONTRACTION = 2.0, 0.5


class Lowest(NamedTuple):
    """Best point, its value, and how many values were computed."""

    x: Vector
    value: float
    evaluations: int


def search(
    value: Callable[[Vector], float], start: Vector, size: float = 0.1, tolerance: float = 1e-6, limit: int = 5_000
) -> Lowest:
    """Lowest of a function by multi-directional search (V. Torczon 1989), the method of [UKF] Section III-B.

    It takes no derivatives, and is here for comparison; no library that we know has it.  All vertices of a simplex but
    the best are reflected through the best one; a success is stretched, a failure shrinks the simplex.

    Parameters
    ----------
    value : callable
        Of a point (n,).
    start : (n,) array
        First vertex.
    size : float
        Distance of the other vertices from it, along the axes.
    tolerance : float
        The search ends when no vertex is farther than this from the best one along any axis,
    limit : int
        or when so many values have been computed.
    """
    simplex = np.vstack([start, start + size * np.eye(start.size)])
    values = np.array([value(x) for x in simplex])
    evaluations = values.size

    def trial(center: Vector, others: Matrix, factor: float) -> tuple[Matrix, Vector]:
        nonlocal evaluations
        points = center + factor * (others - center)
        evaluations += len(points)
        return points, np.array([value(x) for x in points])

    while True:
        order = np.argsort(values, kind="stable")
        simplex, values = simplex[order], values[order]
        best, others = simplex[0], simplex[1:]
        if np.abs(others - best).max() <= tolerance or evaluations >= limit:
            return Lowest(best, float(values[0]), evaluations)
        points, found = trial(best, others, -1.0)
        if found.min() < values[0]:
            stretched, beyond = trial(best, others, -EXPANSION)
            points, found = (stretched, beyond) if beyond.min() < found.min() else (points, found)
        else:
            points, found = trial(best, others, CONTRACTION)
        simplex, values = np.vstack([best, points]), np.concatenate([values[:1], found])
