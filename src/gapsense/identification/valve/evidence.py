"""Which form a record calls for: nested forms, each taken if the evidence is for it.

From the plain form on, each of what may be added is tried in turn, and the one with most evidence is taken, until none
has enough.  Losses may hide in the noise and yet bias all else, so that they are tried where only noise is left, too.
The evidence is the difference of the Bayesian information criteria,

    n ln(S_before / S_after) - k ln n,

with sums S of the squared residuals of the current, k more parameters, and as many independent samples n as the
autocorrelation of what is left afterwards tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.measurements.record import Vector
from gapsense.identification.residual import is_small
from gapsense.identification.valve.form import FITTED, Form
from gapsense.identification.valve.forms import Sought, larger
from gapsense.identification.valve.many import currents
from gapsense.identification.valve.minimise import Fit
from gapsense.identification.valve.prepared import First

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


def chosen(fit: Fit, ratios: Vector, firsts: Sequence[First], sought: Sought) -> list[Trial]:
    """Every form that was tried; the last one that is taken is to be used."""
    best = trial(fit, ratios, firsts)
    tried = [best]
    while not is_quiet(best, firsts) and (forms := larger(best.form, sought)):
        found = [larger_trial(fit, form, best, firsts) for form in forms]
        found.sort(key=lambda trial: trial.evidence)
        if found[-1].evidence < ENOUGH:
            return [*tried, *found]
        best = found[-1]._replace(is_taken=True)
        tried += [*found[:-1], best]
    return tried


def is_quiet(trial: Trial, firsts: Sequence[First]) -> bool:
    """Whether less is left than sampling alone leaves: then nothing can be told."""
    return all(is_small(error, first.record, first.start) for error, first in zip(trial.errors, firsts))


def larger_trial(fit: Fit, form: Form, before: Trial, firsts: Sequence[First]) -> Trial:
    """The larger form, fitted from the smaller one on, and from the first guess of what was added, or of all."""
    experiments, other = [first.of(form) for first in firsts], Fit(form)
    start = carried(before.form, before.ratios, form)
    starts = (start, np.where(np.isin(form.fitted, FITTED), start, 0.0), form.start)
    ends = [other.least_squares(start, experiments) for start in starts]
    found = min((trial(other, ratios, firsts) for ratios in ends), key=lambda t: t.cost)
    fit.samples += other.samples
    left, now = (relative(t.errors, firsts) for t in (before, found))
    more = len({*form.fitted} - {*before.form.fitted})
    return found._replace(evidence=evidence(left, now, more), is_taken=False)


def trial(fit: Fit, ratios: Vector, firsts: Sequence[First]) -> Trial:
    """A form as it is fitted."""
    experiments, par = [first.of(fit.form) for first in firsts], fit.form.at(ratios)
    errors = [e.current - currents([par], e)[0] for e in experiments]
    return Trial(fit.form, ratios, fit.cost(ratios, experiments), errors)


def relative(errors: Sequence[Vector], firsts: Sequence[First]) -> Vector:
    """Errors of all records, relative to their weights."""
    return np.concatenate([error * first.experiment.weights()[0] for error, first in zip(errors, firsts)])


def carried(form: Form, ratios: Vector, to: Form) -> Vector:
    """Ratios of another form, as far as it seeks the same."""
    at = dict(zip(form.fitted, ratios.tolist()))
    at |= {"gap_area": -at["gap_slope"]} if "gap_slope" in at else {}
    return np.array([at.get(name, 0.0) for name in to.fitted])


def evidence(before: Vector, after: Vector, more: int) -> float:
    """For a form with `more` parameters, from what is left before and after."""
    n = independent(after)
    return n * float(np.log((before @ before) / (after @ after))) - more * float(np.log(n))


def independent(r: Vector) -> float:
    """Number of independent samples among residuals; their autocorrelation counts until it is negative."""
    time, square = 1.0, float(r @ r)
    for lag in range(1, r.size // 2):
        rho = float(r[lag:] @ r[:-lag]) / square
        if rho <= 0.0:
            break
        time += 2.0 * rho
    return r.size / time
