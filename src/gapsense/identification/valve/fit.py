"""Parameters of a solenoid valve from recorded voltage and current: [UKF] Section III.

The resistance follows from (23), the parameters of a form from the cost (24)-(25); the gap law, the stops, the
relaxed gap of the spring and the gap at the start are known.  The cost has false minima, so that least squares starts
several times, on the first operation of each record; the best start goes on with all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.identification.assumptions import scale
from gapsense.identification.least_squares import rms
from gapsense.identification.measurements.operations import Flux
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.switching import Carrier
from gapsense.identification.residual import Residual, residual
from gapsense.identification.valve.driver import (
    ROUNDS,
    UNKNOWN,
    Driver,
    Timed,
    choose_timing,
    correction,
    last_taken,
    settle,
)
from gapsense.identification.valve.errors import Uncertainty, add_doubts, doubts, largest, uncertainty, widen
from gapsense.identification.valve.form import (
    BOUNCE,
    EVERYTHING,
    FACTOR,
    FILTER,
    GUESSED,
    LOSSES,
    SHAPE,
    Device,
    Form,
    Sought,
    find_needed,
    larger,
    plain,
    replace_values,
    value_of,
)
from gapsense.identification.valve.minimise import (
    ENOUGH,
    Course,
    Fit,
    Start,
    Trial,
    Weighted,
    best_reading,
    carry_over,
    currents_left,
    evidence,
    search,
)
from gapsense.identification.valve.model import (
    Experiment,
    Prepared,
    Trajectory,
    balance,
    pooled_resistance,
    prepare_all,
    simulate_experiment,
)

STEPS, WHOLE = 12, 8  # of a fit to the first operations, and of those to everything, about
CLEAR = 10.0  # evidence that excludes the other form: "very strong" by Kass and Raftery (1995)
POINTS = 14  # at which a step simulates: for slopes, and with several dampings
SMOOTHED = 0.5  # samples, time constant of a filter, of a first guess
TRIALS = 12  # fits for each level of forms, four forms from three starts; as many for the readings of the voltage


def course_of(prepared: Prepared, starts: int, readings: int, sought: Sought, progress: Progress) -> Course:
    """What is to be expected of a fit with so many starts and readings of the voltage."""
    firsts = sum(first.experiment.current.size for first in prepared.firsts)
    whole = sum(e.current.size for e in prepared.experiments)
    one = float(STEPS * POINTS * firsts)
    tried = TRIALS * one if sought.forms else 0.0
    phases = {
        "starts": starts * one,
        "readings": readings * one + tried if readings else 0.0,
        "forms": tried,
        "whole": float(WHOLE * POINTS * whole),
    }
    return Course(progress, phases, whole)


class Beginning(NamedTuple):
    """What the first operations tell."""

    ratios: Vector
    prepared: Prepared
    starts: list[Start]
    trials: list[Trial]
    causes: Sequence[str]  # that are fitted
    others: Sequence[Timed] = ()  # delays and forms that evidence does not clearly exclude


def begin(
    fit: Fit, prepared: Prepared, found: list[Start], conventions: Sequence[str], sought: Sought, drive: Driver
) -> Beginning:
    """The reading of the voltage, the form and the causes that explain the first operations best, from the best start.

    Without any start that is the first guess, and no form is tried.
    """
    found = [start._replace(cost=fit.cost(start.ratios, prepared.experiments)) for start in found]
    ratios = min(found, key=lambda s: s.cost).ratios if found else fit.form.start
    fit.course.begins("readings")
    if conventions:
        readings = prepared.readings(conventions)
        best, ratios = best_reading(fit, ratios, [reading.firsts for reading in readings], sought)
        prepared = readings[best]
    if prepared.slow and not drive.is_timed:  # edges whose mean delay is not known to the last microsecond
        drive = drive._replace(fitted=(*drive.fitted, "delay"))
    fit.course.begins("forms")
    if not found:
        return Beginning(ratios=ratios, prepared=prepared, starts=found, trials=[], causes=drive.fitted)
    ratios, prepared = settle(fit, ratios, prepared, drive.fitted)
    prepared, trials, causes, others = choose_timing(fit, ratios, prepared, sought, drive)
    fit.form, ratios = last_taken(trials)[:2]
    near = [other for against, other in others if against < CLEAR]
    return Beginning(ratios=ratios, prepared=prepared, starts=found, trials=trials, causes=causes, others=near)


POOR = 0.05  # relative standard error from which a parameter counts as not identifiable
ROUGH = 0.3  # the same of what hardly anything was known of


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
    drive: Mapping[str, float] = {}  # values of the causes that were taken out of the records, see `causes`
    places: Mapping[str, float] = {}  # of edges that lie differently between two samples, likewise [samples]
    slow: str = ""  # sentence on edges that take their time, if it was read so
    carriers: Sequence[Carrier] = ()  # PWM whose edges have no places
    held: Sequence[str] = ()  # parameters that turned out not to be identified, and were held
    alike: Sequence[str] = ()  # other forms that explain the records about as well, which the errors include
    assumed: Mapping[str, float] = {}  # fields that were neither given nor found, and the doubt about their values

    @property
    def names(self) -> tuple[str, ...]:
        """The fitted parameters, and the resistance."""
        return (*(n for n in self.form.fitted if n != FACTOR and not n.startswith(SHAPE)), "coil_resistance")

    @property
    def resistance(self) -> float:
        """Of all records [Ohm]."""
        return float(value_of(self.parameters, "coil_resistance"))

    @property
    def is_explained(self) -> bool:
        """Whether the model explains all records."""
        return all(residual.is_explained for residual in self.residuals)

    @property
    def at_bounds(self) -> list[str]:
        """Parameters at a limit of the search."""
        low, high = self.form.limits
        is_there = (self.ratios < 0.999 * low) | (self.ratios > 0.999 * high)
        return [name for name, there in zip(self.form.fitted, is_there) if there and name in self.names]

    @property
    def is_unsaturated(self) -> bool:
        """Whether the core saturates so little that the search finds no end."""
        return "core_saturation" in self.at_bounds and self.ratios[self.form.fitted.index("core_saturation")] > 0.0

    @property
    def errors(self) -> dict[str, float]:
        """Relative standard errors of the fitted parameters and the resistance; none, infinity, at a limit."""
        found = dict(zip(self.names, self.uncertainty.relative.tolist()))
        return found | dict.fromkeys(self.at_bounds, math.inf)

    @property
    def poor(self) -> list[str]:
        """Parameters that the records do not identify."""
        return [name for name, e in self.errors.items() if not e < (ROUGH if name in GUESSED else POOR)]

    def with_held(self, held: Sequence[str], before: Identified) -> Identified:
        """What was held is no more certain for it: errors are no smaller than those of the fit `before`."""
        errors = dict(zip(before.names, before.uncertainty.relative.tolist()))
        least = np.array([errors[name] for name in self.names])
        wider = self.uncertainty._replace(relative=np.maximum(self.uncertainty.relative, least))
        return self._replace(held=held, uncertainty=wider)


SIZES = (0.1, 0.01)  # first steps of the multi-directional search, before and after the charges are balanced
MUCH = 0.7  # of the squares that are left: with less, places of edges explain much, whatever else is there
TOUCHING, JUMPED = 0.15, 5.0  # samples between an edge and a sample; what is left there, in RMS of all of it
AT_REST = 1e-5  # relative change of the resistances
MOST = 8  # times that charges are balanced


class Found(NamedTuple):
    """A minimum for all operations."""

    form: Form
    ratios: Vector
    experiments: list[Experiment]
    prepared: Prepared  # before the charges were balanced
    causes: Sequence[str]  # that were fitted too


def fit_valve(
    records: Sequence[Record],
    known: Device,
    starts: int,
    seed: int = 1,
    period: float | None = None,
    progress: Progress = lambda done, total: None,
    conventions: Sequence[str] = (),
    sought: Sought = EVERYTHING,
    drive: Driver = UNKNOWN,
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
    sought = sought._replace(guesses={FILTER: SMOOTHED * records[0].dt, **sought.guesses})
    prepared = prepare_all(drive.of(records), period)
    fit = Fit(plain(known, sought), course_of(prepared, starts, len(conventions), sought, progress))
    tried = fit.multi_start([first.experiment for first in prepared.firsts], starts, seed)
    beginning = begin(fit, prepared, tried, conventions, sought, drive)
    fit.course.begins("whole")
    at = _minimise(fit, beginning.ratios, beginning.prepared, beginning.causes, is_searched=not beginning.starts)
    others: list[Found] = []
    if beginning.starts and "eddy" in sought.forms and not drive.is_timed:
        at, *others = _with_edges(fit, at, _forms(known, at.form, _beside(sought, beginning.trials)), drive.fitted)
    others += _nearly_taken(fit, at, beginning.trials)
    for other in beginning.others:  # with another delay, or none, and the form that goes with it
        fit.form, ratios = last_taken(other.trials)[:2]
        others.append(_minimise(fit, ratios, other.prepared, other.causes, is_searched=False))
    fit.form = at.form
    result = _conclude(fit, at, beginning, drive.accuracy)
    fit.form, ratios = result.form.without_lost(at.ratios, _by_noise(result, at))
    held = [name for name in at.form.fitted if name not in fit.form.fitted]
    if held:
        at = _minimise(fit, ratios, at.prepared, at.causes, is_searched=not beginning.starts)
        result = _conclude(fit, at, beginning, drive.accuracy).with_held(held, result)
    return _with_assumed(_with_others(result, at, others), at, sought)


def _nearly_taken(fit: Fit, at: Found, trials: Sequence[Trial]) -> list[Found]:
    """The minima, for all operations, of forms that stood against the one that was taken last, unless it was clear.

    Also of larger ones, if some evidence was for them.
    """
    taken = [k for k, trial in enumerate(trials) if trial.is_taken]
    if not taken or trials[taken[-1]].form.added != at.form.added:
        return []
    last, ends = taken[-1], list[Found]()
    near = [trial for trial in trials[last + 1 :] if trial.evidence > 0.0]
    if len(taken) > 1:
        before = taken[-2]
        against = (trials[before]._replace(evidence=0.0), *trials[before + 1 : last])
        near += [trial for trial in against if trials[last].evidence - trial.evidence < CLEAR]
    for trial in near:
        fit.form = trial.form
        start = carry_over(at.form, at.ratios, trial.form)
        ends.append(_minimise(fit, start, at.prepared, at.causes, is_searched=False))
    fit.form = at.form
    return ends


def _with_others(result: Identified, at: Found, others: Sequence[Found]) -> Identified:
    """The result with what other forms make of it that evidence does not clearly exclude, each as a standard error.

    A misfit that no residual shows, of a voltage between two samples or of the gap, is evidence too.
    """
    alike = [other for other in others if _evidence(at, other) > -CLEAR]
    if not alike:
        return result

    def logarithms(end: Found) -> dict[str, float]:
        par = replace_values(end.form.at(end.ratios), coil_resistance=pooled_resistance(end.experiments))
        sought = (name for name in result.names if name in (*end.form.fitted, "coil_resistance"))
        return {name: math.log(value_of(par, name)) for name in sought}

    here, shifts, none = logarithms(at), list[Vector](), [0.0] * len(result.uncertainty.causes)
    for there in map(logarithms, alike):  # what a form has not is all of it
        moved = [there[n] - here[n] if n in there else float(n in (*LOSSES, FILTER)) for n in result.names]
        shifts.append(np.array([*moved, *none]))
    found = widen(result.uncertainty, largest([np.outer(x, x) for x in shifts]))
    said = dict.fromkeys(", ".join(end.form.added) or "plain" for end in alike)
    return result._replace(uncertainty=found, alike=[*said])


def _with_assumed(result: Identified, at: Found, sought: Sought) -> Identified:
    """The result with what was neither given nor found, and with the doubt about all that was held."""
    known = (*find_needed(at.form), BOUNCE)
    assumed = [] if sought.given is None else [name for name in known if name not in sought.given]
    doubts = {name: scale(name.replace("_", ".")).doubt for name in assumed}
    doubts |= {name: error for name, error in sought.accuracy.items() if name in known}
    tied = {"spring_rest"} & {*assumed}
    found = add_doubts(Weighted(at.form, at.experiments), at.ratios, result.uncertainty, doubts, tied)
    return result._replace(uncertainty=found, assumed={name: doubts[name] for name in assumed})


def _with_edges(fit: Fit, at: Found, forms: Sequence[Form], causes: Sequence[str]) -> list[Found]:
    """The minimum with the place of every edge, if the evidence of all operations is for it; then those not taken.

    First operations tell few.

    Places look much like losses, so that these are judged anew beside them: `forms` are tried, the plainest first.
    """
    names, places = at.prepared.edges, at.prepared.places
    is_placed = {*names} <= {*at.causes}
    if not names or (not is_placed and correction(fit, at.ratios, at.experiments, names, places).is_doubtful):
        return [at]
    alike, best, every = at._replace(prepared=at.prepared.read_between(names)), None, [at]
    for form in forms:
        fit.form, ends = form, list[Found]()
        for start in (alike, best):  # where losses jump with an edge, a search does not cross a sample
            if start:
                ratios = carry_over(start.form, start.ratios, form)
                ends.append(_minimise(fit, ratios, start.prepared, (*causes, *names), is_searched=False))
        found = _across_samples(fit, min(ends, key=lambda end: rms(_left(end))))
        every.append(found)
        if not best or _evidence(best, found) > ENOUGH:
            best = found
    fit.form = at.form
    if not best or best.prepared.is_alike:
        return [at]
    # Places look much like losses: where these were taken and nothing decides, the errors are to have both.
    enough = -ENOUGH if at.form.added else ENOUGH
    if _evidence(at, best) > enough or rms(_left(best)) ** 2 < MUCH * rms(_left(at)) ** 2:
        fit.form, at = best.form, best
    return [at, *(end for end in every if end is not at)]


def _across_samples(fit: Fit, at: Found) -> Found:
    """The minimum with edges on the other side of samples that they nearly touch, where much is left, if it is lower.

    Eddy currents jump with an edge, so that the whole jump is missing at a sample that an edge has crossed wrongly.
    """
    if "core_eddy" not in at.form.fitted:
        return at
    left, by = currents_left(at.form, at.ratios, at.experiments), dict[str, float]()
    for name, place in at.prepared.places.items():
        record, sample = (int(number) for number in name.split(".")[1:])
        edge, e = sample - 0.5 + place - at.experiments[record].first, left[record]
        nearest = min(max(round(edge), 0), e.size - 1)
        if abs(edge - nearest) < TOUCHING and abs(e[nearest]) > JUMPED * rms(e):
            by[name] = 2.0 * (nearest - edge)
    if not by:
        return at
    other = _minimise(fit, at.ratios, at.prepared.move_causes(by), at.causes, is_searched=False)
    return min((at, other), key=lambda end: rms(_left(end)))


def _evidence(before: Found, after: Found) -> float:
    """For a minimum, by all operations."""
    more = len(after.form.fitted) + len(after.causes) - len(before.form.fitted) - len(before.causes)
    return evidence(_left(before), _left(after), more)


def _forms(known: Device, form: Form, sought: Sought) -> list[Form]:
    """The plain form and another one that was taken, each without what is sought and with one part of it."""
    first = plain(known, sought)
    made = [first, *larger(first, sought)]
    return made if any(form.added == one.added for one in made) else [*made, form, *larger(form, sought)]


def _beside(sought: Sought, trials: Sequence[Trial]) -> Sought:
    """What places of edges look much like: eddy currents, and a filter of the current if anything is for it."""
    is_seen = any("filter" in trial.form.added and trial.evidence > 0.0 for trial in trials)
    return sought._replace(forms=("eddy", "filter") if is_seen else ("eddy",))


def _left(at: Found) -> Vector:
    """What it leaves of the current [A]."""
    return np.concatenate(currents_left(at.form, at.ratios, at.experiments))


def _by_noise(result: Identified, at: Found) -> Vector:
    """Standard errors without what a misfit may have done: they tell what these records could tell."""
    if result.is_explained or not at.form.added:
        return result.uncertainty.relative
    return uncertainty(at.form, at.ratios, at.experiments, fitted=at.causes).relative


def _minimise(fit: Fit, ratios: Vector, prepared: Prepared, causes: Sequence[str], is_searched: bool) -> Found:
    """The minimum for all operations, with resistances for which the charges are equal, and in the causes.

    Those depend on what stays of the flux, and it on them: where the core has hysteresis, until they rest.
    """
    experiments = prepared.experiments
    if has_hysteresis := FACTOR in fit.form.fitted:
        experiments = [balance(fit.form, ratios, e) for e in experiments]
        ratios = fit.form.reset(ratios, FACTOR)  # which the resistances have taken now
        others = fit.form.reset(ratios, "core_turnover")  # the minimum of the turnover may be a false one
        ends = [fit.least_squares(start, experiments) for start in (ratios, others)]
        ratios = min(ends, key=partial(fit.cost, experiments=experiments))
    for size in SIZES[-1:] * MOST if has_hysteresis else SIZES:
        value = partial(fit.cost, experiments=experiments)
        ratios = search(value, ratios, size).x if is_searched else fit.least_squares(ratios, experiments)
        before, experiments = experiments, fit.balance_experiments(ratios, experiments)
        ratios = fit.form.reset(ratios, FACTOR)
        if all(np.allclose(a.resistance, b.resistance, rtol=AT_REST, atol=0.0) for a, b in zip(before, experiments)):
            break
    for _ in range(ROUNDS if causes else 0):
        step = correction(fit, ratios, experiments, causes, prepared.places)
        prepared = prepared.move_causes(step.causes)
        experiments = fit.balance_experiments(step.ratios, prepared.experiments)
        ratios = fit.least_squares(fit.form.reset(step.ratios, FACTOR), experiments)
        if step.is_small:
            break
    return Found(form=fit.form, ratios=ratios, experiments=experiments, prepared=prepared, causes=causes)


def _conclude(fit: Fit, at: Found, beginning: Beginning, accuracy: Mapping[str, float]) -> Identified:
    form, ratios, experiments, prepared, causes = at
    par = replace_values(form.at(ratios), coil_resistance=pooled_resistance(experiments))
    models = [simulate_experiment(par, e) for e in experiments]
    left = [residual(record, m, e.first) for record, m, e in zip(prepared.records, models, experiments)]
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
        places=prepared.places,
        slow=prepared.slow,
        carriers=prepared.carriers,
    )
