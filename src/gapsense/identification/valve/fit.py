"""Parameters of a solenoid valve from recorded voltage and current: [UKF] Section III.

The resistance follows from (23), the parameters of a form from the cost (24)-(25); the gap law, the stops, the
relaxed gap of the spring and the gap at the start are known.  The cost has false minima, so that least squares starts
several times, on the first operation of each record; the best start goes on with all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.identification.assumptions import scale
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.residual import residual
from gapsense.identification.valve import model
from gapsense.identification.valve.beginning import Beginning, Method, begun, course_of
from gapsense.identification.valve.device import Device, changed
from gapsense.identification.valve.doubt import Minimum, doubted
from gapsense.identification.valve.drive import ROUNDS, UNKNOWN, Drive, correction
from gapsense.identification.valve.errors import doubts, uncertainty
from gapsense.identification.valve.form import FACTOR, Form
from gapsense.identification.valve.forms import EVERYTHING, Sought, plain
from gapsense.identification.valve.identified import Identified
from gapsense.identification.valve.minimise import Fit
from gapsense.identification.valve.model import Experiment
from gapsense.identification.valve.prepared import Prepared, prepare
from gapsense.identification.valve.scales import BOUNCE, needed
from gapsense.identification.valve.search import search

SIZES = (0.1, 0.01)  # first steps of the multi-directional search, before and after the charges are balanced
AT_REST = 1e-5  # relative change of the resistances
MOST = 8  # times that charges are balanced


class Found(NamedTuple):
    """A minimum for all operations."""

    form: Form
    ratios: Vector
    experiments: list[Experiment]
    prepared: Prepared  # before the charges were balanced
    causes: Sequence[str]  # that were fitted too


def identify(
    records: Sequence[Record],
    known: Device,
    starts: int,
    seed: int = 1,
    period: float | None = None,
    progress: Progress = lambda done, total: None,
    conventions: Sequence[str] = (),
    sought: Sought = EVERYTHING,
    drive: Drive = UNKNOWN,
) -> Identified:
    """Parameters that fit one or more records best.

    Parameters
    ----------
    records : sequence of Record
        Each begins at rest and has complete periods.
    known : Parameters
        Known parameters, and first guesses of the fitted ones.
    starts : int
        Starts of least squares: the first guess, and random ones.  With 0 the multi-directional search of the paper is
        used instead, from the first guess, for the plain form only.
    seed : int
        Of the random starts.
    period : float, optional
        See `operations`.
    progress : callable
        Called with fits done and fits in all.
    conventions : sequence of str
        What the voltage between samples may be: the one that fits best is taken.  None: as the records have it.
    sought : Sought
        What may be added to the plain form, and what is held.
    drive : Drive
        What is known of the driver, and what is fitted.
    """
    method = Method(starts, seed, conventions)
    prepared = prepare(drive.of(records), period)
    fit = Fit(plain(known, sought), course_of(prepared, method, sought, progress))
    beginning = begun(fit, prepared, method, sought, drive)
    fit.course.begins("whole")
    at = _minimum(fit, beginning.ratios, beginning.prepared, beginning.causes, is_searched=not beginning.starts)
    result = _identified(fit, at, beginning, drive.accuracy)
    fit.form, ratios = result.form.without_lost(at.ratios, _by_noise(result, at))
    held = [name for name in at.form.fitted if name not in fit.form.fitted]
    if held:
        at = _minimum(fit, ratios, at.prepared, at.causes, is_searched=not beginning.starts)
        result = _identified(fit, at, beginning, drive.accuracy).with_held(held, result)
    return _with_assumed(result, at, sought)


def _with_assumed(result: Identified, at: Found, sought: Sought) -> Identified:
    """The result with what was neither given nor found, and with the doubt about all that was held."""
    known = (*needed(at.form), BOUNCE)
    assumed = [] if sought.given is None else [name for name in known if name not in sought.given]
    doubts = {name: scale(name.replace("_", ".")).doubt for name in assumed}
    doubts |= {name: error for name, error in sought.accuracy.items() if name in known}
    tied = {"spring_rest"} & {*assumed}
    found = doubted(Minimum(at.form, at.ratios, at.experiments), result.uncertainty, doubts, tied)
    return result._replace(uncertainty=found, assumed={name: doubts[name] for name in assumed})


def _by_noise(result: Identified, at: Found) -> Vector:
    """Standard errors without what a misfit may have done: they tell what these records could tell."""
    if result.is_explained or not at.form.added:
        return result.uncertainty.relative
    return uncertainty(at.form, at.ratios, at.experiments, fitted=at.causes).relative


def _minimum(fit: Fit, ratios: Vector, prepared: Prepared, causes: Sequence[str], is_searched: bool) -> Found:
    """The minimum for all operations, with resistances for which the charges are equal, and in the causes.

    Those depend on what stays of the flux, and it on them: where the core has hysteresis, until they rest.
    """
    experiments = prepared.experiments
    if has_hysteresis := FACTOR in fit.form.fitted:
        experiments = [model.balanced(fit.form, ratios, e) for e in experiments]
        ratios = fit.form.settled(ratios)
        ends = [fit.least_squares(start, experiments) for start in (ratios, fit.form.restarted(ratios))]
        ratios = min(ends, key=partial(fit.cost, experiments=experiments))
    for size in SIZES[-1:] * MOST if has_hysteresis else SIZES:
        value = partial(fit.cost, experiments=experiments)
        ratios = search(value, ratios, size).x if is_searched else fit.least_squares(ratios, experiments)
        before, experiments = experiments, fit.balanced(ratios, experiments)
        ratios = fit.form.settled(ratios)
        if all(np.allclose(a.resistance, b.resistance, rtol=AT_REST, atol=0.0) for a, b in zip(before, experiments)):
            break
    for _ in range(ROUNDS if causes else 0):
        step = correction(fit, ratios, experiments, causes)
        prepared = prepared.moved(step.causes)
        experiments = fit.balanced(step.ratios, prepared.experiments)
        ratios = fit.least_squares(fit.form.settled(step.ratios), experiments)
        if step.is_small:
            break
    return Found(form=fit.form, ratios=ratios, experiments=experiments, prepared=prepared, causes=causes)


def _identified(fit: Fit, at: Found, beginning: Beginning, accuracy: Mapping[str, float]) -> Identified:
    form, ratios, experiments, prepared, causes = at
    par = changed(form.at(ratios), coil_resistance=model.pooled_resistance(experiments))
    models = [model.simulated(par, e) for e in experiments]
    every = zip(prepared.records, models, prepared.fluxes)
    left = [residual(record, m, flux.operations[0].start) for record, m, flux in every]
    return Identified(
        parameters=par,
        form=form,
        uncertainty=uncertainty(form, ratios, experiments, doubts(prepared, left, accuracy), causes),
        cost=fit.cost(ratios, experiments),
        starts=beginning.starts,
        evaluations=round(fit.samples / sum(e.current.size for e in experiments)),
        fluxes=prepared.fluxes,
        models=models,
        convention=prepared.convention,
        residuals=left,
        ratios=ratios,
        trials=beginning.trials,
        drive=prepared.drive,
    )
