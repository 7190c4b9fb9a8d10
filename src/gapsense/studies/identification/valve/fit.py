"""Parameters of a solenoid valve from recorded voltage and current: [UKF] Section III.

The resistance follows from (23), the parameters of a form from the cost (24)-(25); the gap law, the stops, the
relaxed gap of the spring and the gap at the start are known.  The cost has false minima, so that least squares starts
several times, on the first operation of each record; the best start goes on with all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from gapsense.studies.identification.residual import Residual, residual
from gapsense.studies.identification.valve import model
from gapsense.studies.identification.valve.device import Device, changed, value
from gapsense.studies.identification.valve.errors import Uncertainty, doubts, uncertainty
from gapsense.studies.identification.valve.evidence import Trial, chosen
from gapsense.studies.identification.valve.form import FACTOR, GUESSED, SHAPE, Form
from gapsense.studies.identification.valve.forms import EVERYTHING, Sought, plain
from gapsense.studies.identification.valve.minimise import Fit, Start
from gapsense.studies.identification.valve.model import Experiment, Trajectory, cost
from gapsense.studies.identification.valve.prepared import Prepared, prepare
from gapsense.studies.identification.valve.search import search
from gapsense.studies.identification.valve.voltage import best_reading
from gapsense.studies.records.flux import Flux
from gapsense.studies.records.record import Record, Vector
from gapsense.workers import Progress

POOR = 0.05  # relative standard error from which a parameter counts as not identifiable
ROUGH = 0.3  # the same of what hardly anything was known of
SIZES = (0.1, 0.01)  # first steps of the multi-directional search, before and after the charges are balanced
AT_REST = 1e-5  # relative change of the resistances
MOST = 8  # times that charges are balanced


class Identified(NamedTuple):
    """What was found, and how."""

    parameters: Device  # complete set, known ones included
    form: Form  # what was sought
    uncertainty: Uncertainty  # in that order
    cost: float  # J of (24)
    starts: list[Start]  # empty for the multi-directional search
    evaluations: int  # simulations of all records; a shorter one counts in proportion
    fluxes: list[Flux]  # resistances and flux linkage of each record
    models: list[Trajectory]  # what the model does, from the first operation of each record on
    convention: str  # the voltage between samples, see `record.halves`
    residuals: list[Residual]  # of each record
    ratios: Vector  # logarithms, of the fitted parameters to their first guesses
    trials: list[Trial]  # forms that were tried
    held: Sequence[str] = ()  # parameters that turned out not to be identified, and were held

    @property
    def names(self) -> tuple[str, ...]:
        """The fitted parameters, and the resistance."""
        return (*(n for n in self.form.fitted if n != FACTOR and not n.startswith(SHAPE)), "coil_resistance")

    @property
    def resistance(self) -> float:
        """Of all records [Ohm]."""
        return float(value(self.parameters, "coil_resistance"))

    @property
    def is_explained(self) -> bool:
        """Whether the model explains all records."""
        return all(residual.is_explained for residual in self.residuals)

    @property
    def at_bounds(self) -> list[str]:
        """Parameters at a limit of the search."""
        is_there = np.abs(self.ratios) > 0.999 * self.form.bounds
        return [name for name, there in zip(self.form.fitted, is_there) if there and name in self.names]

    @property
    def poor(self) -> list[str]:
        """Parameters that the records do not identify."""
        errors = zip(self.names, self.uncertainty.relative)
        return [name for name, error in errors if not error < (ROUGH if name in GUESSED else POOR)]


class Found(NamedTuple):
    """A minimum for all operations."""

    form: Form
    ratios: Vector
    experiments: list[Experiment]


def identify(
    records: Sequence[Record],
    known: Device,
    starts: int,
    seed: int = 1,
    period: float | None = None,
    progress: Progress = lambda done, total: None,
    conventions: Sequence[str] = (),
    sought: Sought = EVERYTHING,
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
    """
    fit, convention, trials = Fit(plain(known, sought)), "", list[Trial]()
    prepared = prepare(records, period)
    found = fit.multi_start([first.experiment for first in prepared.firsts], starts, seed, progress) if starts else []
    ratios = min(found, key=lambda s: s.cost).ratios if found else fit.form.start
    if conventions:
        readings = [prepare(records, period, name) for name in conventions]
        best, ratios = best_reading(fit, ratios, [reading.firsts for reading in readings], sought)
        convention, prepared = conventions[best], readings[best]
    if found:
        trials = chosen(fit, ratios, prepared.firsts, sought)
    for trial in trials:
        fit.form, ratios = (trial.form, trial.ratios) if trial.is_taken else (fit.form, ratios)
    at = _minimum(fit, ratios, prepared.experiments, is_searched=not found)
    result = _identified(fit, at, prepared, found, convention, trials)
    fit.form, ratios = result.form.without_lost(at.ratios, _by_noise(result, at))
    held = [name for name in at.form.fitted if name not in fit.form.fitted]
    if not held:
        return result
    at = _minimum(fit, ratios, at.experiments, is_searched=not found)
    return _identified(fit, at, prepared, found, convention, trials)._replace(held=held)


def _by_noise(result: Identified, at: Found) -> Vector:
    """Standard errors without what a misfit may have done: they tell what these records could tell."""
    errors = result.uncertainty if result.is_explained or not at.form.added else uncertainty(*at)
    return errors.relative


def _minimum(fit: Fit, ratios: Vector, experiments: list[Experiment], is_searched: bool) -> Found:
    """The minimum for all operations, with resistances for which the charges are equal.

    Those depend on what stays of the flux, and it on them: where the core has hysteresis, until they rest.
    """
    if has_hysteresis := FACTOR in fit.form.fitted:
        experiments = [model.balanced(fit.form, ratios, e) for e in experiments]
        ratios = fit.form.settled(ratios)
        ends = [fit.least_squares(start, experiments) for start in (ratios, fit.form.restarted(ratios))]
        ratios = min(ends, key=partial(fit.cost, experiments=experiments))
    for size in SIZES[-1:] * MOST if has_hysteresis else SIZES:
        value = partial(fit.cost, experiments=experiments)
        ratios = search(value, ratios, size).x if is_searched else fit.least_squares(ratios, experiments)
        before, experiments = experiments, [model.balanced(fit.form, ratios, e) for e in experiments]
        ratios = fit.form.settled(ratios)
        if all(np.allclose(a.resistance, b.resistance, rtol=AT_REST, atol=0.0) for a, b in zip(before, experiments)):
            break
    return Found(fit.form, ratios, experiments)


def _identified(
    fit: Fit, at: Found, prepared: Prepared, starts: list[Start], convention: str, trials: list[Trial]
) -> Identified:
    form, ratios, experiments = at
    par = changed(form.at(ratios), coil_resistance=model.pooled_resistance(experiments))
    models = [model.simulated(par, e) for e in experiments]
    every = zip(prepared.records, models, prepared.fluxes)
    left = [residual(record, m, flux.operations[0].start) for record, m, flux in every]
    return Identified(
        parameters=par,
        form=form,
        uncertainty=uncertainty(form, ratios, experiments, doubts(prepared.records, left)),
        cost=cost(model.residuals(form, ratios, experiments)),
        starts=starts,
        evaluations=round(fit.samples / sum(e.current.size for e in experiments)),
        fluxes=prepared.fluxes,
        models=models,
        convention=convention,
        residuals=left,
        ratios=ratios,
        trials=trials,
    )
