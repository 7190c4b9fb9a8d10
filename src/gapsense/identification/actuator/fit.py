"""All parameters of `Mhe` from records of voltage and current: least squares over whole records, from rest.

The fit seeks the logarithms of factors of the believed values, each with a deviation that says how wrong that may be,
and the places of the edges. Its cost is

    sum w^2 (i - i_model)^2 + sum (log factor / deviation)^2 + sum (place / deviation)^2.

Coil and core come first, from the first quarter of each record; then all parameters, from its first half and from the
whole of it. Far from the minimum a long record is wrong by whole motions, and says little.

What that leaves of the current asks for more: the length along which the flux of the gap fringes, another knee b m^n of
the core, and stops from which the mover comes back.  A longer fringe is a leak G beside the gap, R/(1 + G R): with
R = R' z/(1 + k z ln(c/z)) only c changes, to c exp(G R'/k).  A mover that bounces has many minima; so the records are
taken piece by piece.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from gapsense._os.workers import Progress
from gapsense.estimators.mhe.model import Parameters, device, gap_law, make_gap
from gapsense.estimators.reduced_model import SMALLEST_GAP, GapLaw
from gapsense.identification.actuator import kernel as simulated
from gapsense.identification.actuator.drive import ALIKE, LEFT, Excitation, read_excitation
from gapsense.identification.actuator.kernel import USUAL, Beyond
from gapsense.identification.least_squares import (
    STEP,
    Matrix,
    Vector,
    differences,
    finite,
    independent,
    minimise,
    promise,
    rms,
    sample_outputs,
)
from gapsense.identification.measurements.record import Record
from gapsense.identification.measurements.signals import ANYWHERE
from gapsense.identification.residual import EXPLAINED, FLOOR, Residual, rounding
from gapsense.identification.residual import residual as of_all
from gapsense.identification.show import Validation
from gapsense.identification.valve.model import Trajectory
from gapsense.kernels.kernel import Kernel

DEVIATIONS = {  # of the logarithms: how wrong what is believed may be; up to 10 %, all alike, is 6 %
    "coil_resistance": 0.15,
    "core_eddy": 1.0,
    "core_reluctance": 0.4,
    "core_bend": 0.4,
    "core_saturation": 0.06,
    "core_hysteresis": 1.0,
    "core_turnover": 0.7,
    "gap_factor": 0.06,
    "gap_fringing": 0.1,
    "mover_mass": 0.06,
    "spring_stiffness": 0.06,
    "spring_rest": 0.06,
    "damping": 0.075,
}
STOPS, REBOUND, KNEE = ("contact_stiffness", "contact_damping"), ("stop_restitution",), ("core_power",)
BOUNCES = {"stop_restitution": 0.9, "contact_stiffness": 1.0, "contact_damping": 1.0}  # the same, of stops
MORE = {"core_bend": 1.5, "core_power": 0.3, "gap_fringing": 1.0, "gap_window": 1.0}  # and with another knee
FORMS = (REBOUND, KNEE, (*KNEE, *REBOUND), (*KNEE, *STOPS))  # of the model, the smallest first
PLACE_STEP = 1e-3  # of a difference quotient
BESIDE = 2  # numbers that a record has beside the places of its edges: offset, and what these share
KERNEL = Kernel(simulated)


class Problem(NamedTuple):
    """The cost, for some of the parameters and the first part of some records."""

    known: Parameters
    names: list[str]
    drives: Sequence[Excitation]
    is_alike: bool = False  # all edges of a record lie alike in their periods
    doubts: Mapping[str, float] = {}  # deviations of what was assumed, in place of the usual ones
    beyond: Beyond = USUAL

    @property
    def deviations(self) -> Vector:
        """How wrong what is sought may be: factors, then by record its offset, what its edges share, and each."""
        parts, one = [np.array([*self.believed.values()])], ALIKE if self.is_alike else ANYWHERE
        for drive in self.drives:
            parts += [np.array([drive.doubt, ANYWHERE]), np.full(drive.edges.size, one)]
        return np.concatenate(parts)

    @property
    def believed(self) -> dict[str, float]:
        """How wrong what is believed may be, by field."""
        sharp = MORE if self.beyond.core_power else {}
        return {name: {**DEVIATIONS, **BOUNCES, **sharp, **self.doubts}[name] for name in self.names}

    def places(self, x: Vector) -> list[Vector]:
        """Those of the edges of each record."""
        return [x[at.start + 1] + x[at.start + BESIDE : at.stop] for at in self.columns]

    def offsets(self, x: Vector) -> list[float]:
        """What is left of that of each current [A]."""
        return [float(x[at.start]) for at in self.columns]

    @property
    def columns(self) -> list[slice]:
        """Where what belongs to one record is among all that is sought."""
        ends = len(self.names) + np.cumsum([BESIDE + drive.edges.size for drive in self.drives])
        return [slice(int(end) - BESIDE - drive.edges.size, int(end)) for end, drive in zip(ends, self.drives)]

    @property
    def scale(self) -> Vector:
        """Steps are damped by how wrong what is sought may be."""
        return self.deviations

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Lowest and highest point."""
        places = self.deviations.size - len(self.names)
        high = np.append([furthest(*each) for each in self.believed.items()], np.ones(places))
        return -high, high

    def residuals(self, points: Sequence[Vector]) -> Matrix:
        """For each of some points: their squares add up to the cost, with large ones instead of NaN."""
        pars, found = [parameters_at(self, x) for x in points], []
        for k, drive in enumerate(self.drives):
            volts = np.stack([drive.voltage(self.places(x)[k]) for x in points], axis=1)
            offsets = np.array([[self.offsets(x)[k]] for x in points])
            found.append(drive.weights * (drive.current - offsets - sample_models(pars, drive, volts)))
        return finite(np.hstack([*found, np.array(points) / self.deviations]))

    def jacobian(self, x: Vector, _: Vector | None = None, /) -> Matrix:
        """Derivatives of the residuals."""
        free, row = len(self.names), 0
        J = np.zeros((sum(d.current.size for d in self.drives) + x.size, x.size))
        pars = [parameters_at(self, x), *(parameters_at(self, x + STEP * e) for e in np.eye(free, x.size))]
        for drive, places, columns in zip(self.drives, self.places(x), self.columns):
            rows = slice(row, row := row + drive.current.size)
            J[rows, :free], J[rows, columns] = slopes(pars, drive, places)
        J[row:] = np.diag(1.0 / self.deviations)
        return finite(J)


def slopes(pars: Sequence[simulated.Parameters], drive: Excitation, places: Vector) -> tuple[Matrix, Matrix]:
    """Derivatives of the residuals of a record: by logarithms, then by its offset, all places together, and each."""
    by = np.where(places > 0.0, -PLACE_STEP, PLACE_STEP)  # inwards
    volts = same_volts(drive, places, len(pars))
    models = [*pars, *[pars[0]] * places.size]
    at, *others = -drive.weights * sample_models(models, drive, np.hstack([volts, drive.move_each_edge(places, by)]))
    off = (np.array(others) - at).T
    each = off[:, len(pars) - 1 :] / by
    return off[:, : len(pars) - 1] / STEP, np.hstack([-drive.weights[:, None], each.sum(axis=1, keepdims=True), each])


def parameters_at(p: Problem, x: Vector) -> simulated.Parameters:
    """What is known, multiplied by factors."""
    factors = dict(zip(p.names, np.exp(x[: len(p.names)]).tolist()))

    def apply_factors(part: Any) -> Any:
        return part._replace(**{n: getattr(part, n) * factors[n] for n in part._fields if n in factors})

    return simulated.Parameters(apply_factors(p.known), apply_factors(p.beyond))


def same_volts(drive: Excitation, places: Vector, models: int) -> Matrix:
    """Mean voltages of the steps of a record for each of some models, (steps, models)."""
    return np.repeat(drive.voltage(places)[:, None], models, axis=1)


def sample_models(
    pars: Sequence[simulated.Parameters], drive: Excitation, volts: Matrix, name: str = "current"
) -> Matrix:
    """Currents of several models, or another output, at the samples, (models, samples).

    `volts` are those of each, (steps, models).
    """
    every = np.vstack([np.zeros((1, len(pars))), volts])
    pars = [par._replace(known=par.known._replace(sample_time=drive.step)) for par in pars]
    return sample_outputs(KERNEL, pars, every[:, None, :], name)[:, :: drive.parts]


def sample_record(
    pars: Sequence[simulated.Parameters], drive: Excitation, places: Vector, name: str = "current"
) -> Matrix:
    """The same of models that all have the voltages of one record."""
    return sample_models(pars, drive, same_volts(drive, places, len(pars)), name)


def simulate(
    par: Parameters, drive: Excitation, places: Vector, offset: float = 0.0, beyond: Beyond = USUAL
) -> Trajectory:
    """The model at each sample of a record, with the offset that its current has."""
    rows = run(par._replace(sample_time=drive.step), [0.0, *drive.voltage(places).tolist()], beyond)[:: drive.parts]
    current, flux_linkage, position = rows.T
    return Trajectory(current + offset, flux_linkage, position)


def run(par: Parameters, volts: list[float], beyond: Beyond = USUAL) -> Matrix:
    """Current, flux linkage and position after each step with its mean voltage; the first row is the start, at rest."""
    return np.array(KERNEL.run([(u,) for u in volts], simulated.Parameters(par, beyond))[1])


LONGEST, ENOUGH = 25, 1e-5  # steps, and relative fall of the cost with which they end
FURTHEST, GUESSED = math.log(10.0), math.log(1000.0)  # of a logarithm, and of one of losses; 1 for places and offsets
NEAR = 0.999  # part of it that is at the limit
PROMISES = 0.1  # part of the cost that a step promises: with more it is no minimum


def furthest(name: str, deviation: float) -> float:
    """How far a logarithm may go: losses are guesses, up to solid cores."""
    return GUESSED if deviation >= 1.0 or name == "core_turnover" else FURTHEST


CAUSES = {
    "edges": "pulses that are shorter than a sampling period, so that samples miss some: record more samples or, with"
    " a filter, the mean voltage",
    "motion": "the mechanics: stops, turns, spring or gap law that are not as given, dry friction, or bounces",
    "hold": "a voltage that is not the coil's (drops of the driver, a supply that sags, PWM sampled in step), or a coil"
    " that gets warm",
    "decay": "a drop in the path of the falling current, or a core with other hysteresis",
    "rest": "an offset of the current, or flux from an operation before",
}


def residual(drive: Excitation, model: Trajectory, model_error: float) -> Residual:
    """What the model leaves of the currents that count; its own error explains as much as `Mhe` takes it to be [A]."""
    counts, current = drive.weights > 0.0, drive.record.current.copy()
    current[drive.first :][~counts] = model.current[~counts]
    found = of_all(drive.record._replace(current=current), model, drive.first)
    floor = found.limit if found.limit > EXPLAINED * found.noise else 0.0  # of the largest current
    return found._replace(
        rms=found.rms * float(np.sqrt(counts.size / max(1, counts.sum()))),
        noise=drive.noise,
        limit=max(EXPLAINED * drive.noise, floor, float(model_error)),
    )


ELECTRIC = {name for name in (*DEVIATIONS, *MORE) if name.startswith(("coil", "core")) and name != "core_turnover"}
BIASED = 0.03  # sampling periods by which the rising edges may be found later than the falling ones
CHANCE = 2.0  # squares that a number explains without meaning (AIC)
CLEAR = 4.0  # standard errors of a correlation
LAW_ERROR, LAW_SHAPES = 7.5e-3, 3  # of a gap law, relative; cosines along the stroke
SMALLER = 0.1  # the third step of a difference quotient by them, over the others
LAW_ROWS, LAW_ENDS = 201, 0.2  # of a table of it, and how far it goes beyond the stops, in strokes
QUANTILES = 200  # of flux linkages
STIFF, SOFT, BACK = 0.15, 0.5, 0.3  # first guesses: angular frequency of the mover by the step, damping, restitution
SHARP, BENT = 10.0, 0.9  # first guess of the exponent, and share of saturation at which the knee stays
STARTS = ({"core_eddy": 2.0, "core_reluctance": -1.5}, {"core_eddy": -2.0})  # more logarithms to begin with
USUAL_ERROR = 1e-3  # of the model, at least [A]
SHARES = (0.25, 0.5, 1.0)  # of each record that is used, one after the other
PIECES, ROUGH = np.linspace(0.01, 1.0, 100).tolist(), 1e-3  # the same, of many minima, and the fall with which they end
FAR_LESS = 0.5  # part of a residual
AS_BEFORE, LOST = 1.05, 25.0  # squares that a sample of a piece leaves, over those of the last one; and at most


class Commissioned(NamedTuple):
    """What was found, and how well."""

    parameters: Parameters  # complete set
    beyond: Beyond  # what `Mhe` has not
    names: list[str]  # fields that were fitted
    covariance: Matrix  # of their logarithms
    law_moves: Matrix  # by how much these move with each shape of the gap law that may be wrong (n, shapes)
    misfit: float  # cost over what noise and error of the model make
    drives: Sequence[Excitation]
    places: Sequence[Vector]  # of the edges of each record, in sampling periods after the middle
    models: Sequence[Trajectory]
    residuals: Sequence[Residual]  # of the currents that count
    believed: Mapping[str, float]  # how wrong what was believed may have been, by field
    steps: int  # of the search
    promise: float  # part by which its next step would lower the cost, if that were a parabola
    at_limit: Sequence[str]  # fields that end where the search does, `furthest` from what was believed

    @property
    def errors(self) -> dict[str, float]:
        """Relative standard errors by field; none, infinity, at a limit of the search."""
        found = dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))
        return found | dict.fromkeys(self.at_limit, math.inf)

    @property
    def is_explained(self) -> bool:
        """Whether the model explains all records, and these tell when the voltage switched."""
        return all(r.is_explained for r in self.residuals) and not any(d.is_too_fast for d in self.drives)

    @property
    def is_minimum(self) -> bool:
        """Whether the search came to rest."""
        return self.is_explained or self.promise < PROMISES

    @property
    def model(self) -> Trajectory:
        """The model beside the first record."""
        return self.models[0]


def commission(
    records: Sequence[Record],
    known: Parameters,
    progress: Progress = lambda done, total: None,
    doubts: Mapping[str, float] | None = None,
) -> Commissioned:
    """Parameters that explain records, near those that are known.

    More is sought where the usual numbers leave more than noise, and is kept if it explains the records and the
    evidence is for it.  `doubts` are the deviations of fields that were assumed: they are sought with all else, for
    what is as uncertain makes all that goes with it uncertain.
    """
    known = known._replace(model_error=believed_error(known, records))
    drives = [read_excitation(record, known) for record in records]
    par, doubts = with_bend(known), doubts or {}
    names = [name for name in dict.fromkeys((*DEVIATIONS, *doubts)) if is_fitted(par, name)]
    every = Problem(par, names, drives, doubts=doubts)
    found = search(every, progress)
    is_too_fast = any(d.is_too_fast for d in drives)  # nothing explains it
    if not found.is_explained and not is_too_fast:
        found = min((found, *(search(every, progress, start=start) for start in STARTS)), key=lambda each: each.misfit)
    if leaves_more(found) and not is_too_fast:
        for form in FORMS:
            richer = search(with_more(every, form), progress, in_pieces=True)
            found = richer if is_sound(richer, found) and is_better(richer, found) else found
    return found


def believed_error(known: Parameters, records: Sequence[Record]) -> float:
    """The error of the model that a fit begins with; what the nearest model leaves of a table is sought anew [A]."""
    largest = max(float(np.abs(record.current).max()) for record in records)
    return min(float(known.model_error), max(USUAL_ERROR, FLOOR * largest))


def leaves_more(found: Commissioned) -> bool:
    """Whether neighbouring residuals are alike beyond chance, by more than the model's error is believed to be."""
    error, sizes = float(found.parameters.model_error), [CLEAR / math.sqrt(d.current.size) for d in found.drives]
    alike = [r.correlation * r.rms**2 > error**2 + size * r.rms**2 for r, size in zip(found.residuals, sizes)]
    return any(alike) or not found.is_explained


def is_sound(richer: Commissioned, found: Commissioned) -> bool:
    """Whether it explains the records, or leaves far less than one that does not either."""
    left = [max(r.rms for r in each.residuals) for each in (richer, found)]
    return richer.is_explained or (not found.is_explained and left[0] < FAR_LESS * left[1])


def is_better(richer: Commissioned, found: Commissioned) -> bool:
    """Whether the evidence is for more numbers (G. Schwarz 1978); neighbouring residuals that are alike count once."""
    before, after = map(left_of, (found, richer))
    n = independent(before)
    more = len(richer.names) - len(found.names)
    return bool(n * math.log(float(before @ before) / float(after @ after)) > more * math.log(n))


def left_of(result: Commissioned) -> Vector:
    """What the models leave of the currents that count."""
    return np.concatenate([(d.current - m.current)[d.weights > 0.0] for d, m in zip(result.drives, result.models)])


def with_more(p: Problem, form: Sequence[str]) -> Problem:
    """With stops from which the mover comes back, or another knee, of which the saturation is no part, and a leak."""
    par, names, beyond = p.known, [name for name in p.names if name not in form], USUAL
    if "core_power" in form:
        names = [name for name in names if name not in ("core_saturation", "gap_window")]
        names += ["gap_window"] if is_fitted(par, "gap_window") else []
        par = par._replace(core_bend=par.core_bend * BENT ** (3.0 - SHARP) / (1.0 - BENT**2))
        beyond = beyond._replace(core_power=SHARP)
    if "stop_restitution" in form:
        par = par._replace(stop_restitution=par.stop_restitution or BACK)
    if "contact_stiffness" in form:
        stiffness = float(par.mover_mass) * (STIFF / max(d.step for d in p.drives)) ** 2
        beyond = beyond._replace(contact_stiffness=stiffness, contact_damping=SOFT)
    return p._replace(known=par, names=[*names, *form], beyond=beyond)


def search(
    every: Problem, progress: Progress, in_pieces: bool = False, start: Mapping[str, float] | None = None
) -> Commissioned:
    """What explains the records, from what is believed on, or from other logarithms, by ever larger shares of them.

    In pieces it ends where one is not explained, and takes no step where one is by what was found before.
    """
    x, steps, last, shares = np.zeros(every.deviations.size), 0, 0.0, PIECES if in_pieces else SHARES
    x[: len(every.names)] = [(start or {}).get(name, 0.0) for name in every.names]
    for k, share in enumerate(shares):
        progress(k, len(shares) + 1)
        free = [j for j, name in enumerate(every.names) if k or name in ELECTRIC]
        parts = [d.count_only_first(share) if in_pieces else d.shorten_to(share) for d in every.drives]
        part = every._replace(names=[every.names[j] for j in free], drives=parts)
        at = np.array([*free, *places_sought(every.drives, parts, len(every.names))])
        count = sum(np.count_nonzero(d.weights) for d in parts)
        if in_pieces and share < 1.0 and (part.residuals([x[at]]) ** 2).sum() < AS_BEFORE * last * count:
            continue
        found = minimise(part, x[at], LONGEST, ROUGH if in_pieces and share < 1.0 else ENOUGH)
        x[at], steps, last = found.point, steps + found.steps, float(found.residuals @ found.residuals) / count
        if in_pieces and last > LOST:
            break
    progress(len(shares), len(shares) + 1)
    return conclude(*in_step(every, x), steps)


def in_step(p: Problem, x: Vector) -> tuple[Problem, Vector]:
    """The same with edges that all lie alike, unless places of their own explain more than by chance."""
    alike, at = p._replace(is_alike=True), x.copy()
    for columns in p.columns:
        at[columns.start + BESIDE : columns.stop] = 0.0
    at = minimise(alike, at, LONGEST, ENOUGH).point
    after, before = (sum_squares(p, point) for point in (at, x))
    edges = sum(d.edges.size for d in p.drives)
    return (alike, at) if after - before < CHANCE * edges else (p, x)


def sum_squares(p: Problem, x: Vector) -> float:
    """Sum the squares of what is left of the currents, in noises."""
    (r,), first, total = p.residuals([x]), 0, 0.0
    for one in p.drives:
        part = r[first : (first := first + one.current.size)]
        total += float(part @ part) / float(one.weights.max() * one.noise) ** 2
    return total


def places_sought(drives: Sequence[Excitation], parts: Sequence[Excitation], first: int) -> list[int]:
    """Where the places of edges in the first parts of records are among all that is sought."""
    found = list[int]()
    for whole, part in zip(drives, parts):
        found += range(first, first + BESIDE + part.edges.size)
        first += BESIDE + whole.edges.size
    return found


def conclude(p: Problem, x: Vector, steps: int) -> Commissioned:
    """What a minimum says."""
    J, (r,) = p.jacobian(x), p.residuals([x])
    n, places, found = len(p.names), p.places(x), parameters_at(p, x)
    misfit = float(r @ r - r[-x.size :][:n] @ r[-x.size :][:n]) / usual(p)
    pulls = (
        float(np.mean((x[:n] / p.deviations[:n]) ** 2)) if n else 0.0
    )  # what was believed disagrees with the records
    covariance: Matrix = max(1.0, misfit) * np.linalg.inv(J.T @ J).astype(np.float64)[:n, :n]
    covariance[0, 0] += doubt(p) ** 2  # the resistance is the first
    models = [simulate(found.known, *of_record, found.beyond) for of_record in zip(p.drives, places, p.offsets(x))]
    residuals = [residual(d, model, p.known.model_error) for d, model in zip(p.drives, models)]
    has_law = "gap_window" in p.names or p.known.gap_law == GapLaw.table
    law_moves: Matrix = np.zeros((n, 0))

    def weigh_currents(pars: Sequence[simulated.Parameters]) -> Matrix:
        return np.hstack([d.weights * sample_record(pars, d, at) for d, at in zip(p.drives, places)])

    if has_law and p.beyond.core_power and all(r.is_explained for r in residuals):
        law_moves = np.asarray(np.linalg.solve(J.T @ J, J[: -x.size].T @ law_errors(found, weigh_currents).T))[:n]
    return Commissioned(
        parameters=found.known,
        beyond=found.beyond,
        names=p.names,
        covariance=max(1.0, pulls) * (covariance + law_moves @ law_moves.T),
        law_moves=law_moves,
        misfit=misfit,
        drives=p.drives,
        places=places,
        models=models,
        residuals=residuals,
        believed=p.believed,
        steps=steps,
        promise=promise(p, x, J, r),
        at_limit=[
            name for name, ratio in zip(p.names, x.tolist()) if abs(ratio) > NEAR * furthest(name, p.believed[name])
        ],
    )


def with_usual_knee(result: Commissioned) -> tuple[Commissioned, float]:
    """What was found with the knee that estimators have in place of b m^n; and the current that this leaves, RMS [A].

    Least squares of the static current over the flux linkages of the records.
    """
    par, area, n = result.parameters, result.parameters.coil_turns**2, result.beyond.core_power
    if not n:
        return result, 0.0
    all_lam = np.abs(np.concatenate([model.flux_linkage for model in result.models]))
    lam = np.quantile(all_lam, np.linspace(0.0, 1.0, QUANTILES))
    fields = ("core_reluctance", "core_bend", "core_power")
    known = np.array([par.core_reluctance, par.core_bend, n])

    def left(x: Vector, logs: Vector) -> Vector:
        (core, bend, power), (own, steep, room) = known * np.exp(logs), np.exp(x)
        m = lam / (lam.max() * (1.0 + room))
        usual = own * lam + steep * m**2 / (1.0 - m**2) * lam
        sharp = core * lam + bend * (lam / par.core_saturation) ** (power - 1.0) * lam
        return np.asarray((usual - sharp) / area)

    def values(points: Sequence[Vector]) -> Matrix:
        start = np.log([par.core_reluctance, 0.1 * par.core_reluctance, 0.05])
        found = np.array([least_squares(left, start, args=(logs,), x_scale="jac").x for logs in points])
        found[:, 2] = np.log(lam.max() * (1.0 + np.exp(found[:, 2])))
        return found

    (at,) = values([np.zeros(3)])
    places = [result.names.index(name) for name in fields]
    T = np.eye(len(result.names))
    T[np.ix_(places, places)] = differences(values, np.zeros(3))
    names = [{"core_power": "core_saturation"}.get(name, name) for name in result.names]
    core, bend, saturation = np.exp(at).tolist()
    found = result._replace(
        parameters=par._replace(core_reluctance=core, core_bend=bend, core_saturation=saturation),
        beyond=result.beyond._replace(core_power=0.0),
        names=names,
        covariance=T @ result.covariance @ T.T,
    )
    room = np.log(saturation / lam.max() - 1.0)
    return found, rms(left(np.array([at[0], at[1], room]), np.zeros(3)))


def with_other_law(known: Parameters, shape: int, by: float) -> Parameters:
    """The same with a gap law that is off by a share of a cosine along the stroke."""
    low, high = float(known.stop_lower), float(known.stop_upper)
    gaps = np.linspace(low - LAW_ENDS * (high - low), high + LAW_ENDS * (high - low), LAW_ROWS)
    gaps, law = gaps[gaps > SMALLEST_GAP], make_gap(known)
    R = known.coil_turns**2 * np.array([gap_law(h, law)[0] for h in gaps.tolist()])
    changed = R * (1.0 + by * np.cos(shape * np.pi * (gaps - low) / (high - low)))
    columns = (gaps, changed, CubicSpline(gaps, changed)(gaps, 2))
    table = dict(zip(("gap_file_gap", "gap_file_reluctance", "gap_file_spline"), (c.tolist() for c in columns)))
    return known._replace(gap_law=float(GapLaw.table), **table)


def law_errors(found: simulated.Parameters, values: Callable[[Sequence[simulated.Parameters]], Matrix]) -> Matrix:
    """What a gap law that is not quite the one given changes in some values of each model (shapes, values).

    Of three difference quotients that in the middle: where the last bounce is a bounce more or less, one has a jump.
    """
    steps = (STEP, -STEP, SMALLER * STEP)
    changes = [(shape, by) for shape in range(1, LAW_SHAPES + 1) for by in steps]
    laws = [with_other_law(found.known, shape, by) for shape, by in ((1, 0.0), *changes)]
    at, *others = values([found._replace(known=known) for known in laws])
    rates = np.array([(other - at) / by for other, (_, by) in zip(others, changes)])
    return np.asarray(LAW_ERROR * np.median(rates.reshape(LAW_SHAPES, len(steps), -1), axis=1))


def position_error(result: Commissioned) -> float:
    """What the standard errors of all parameters do to the position of the model, RMS in the worst record [m].

    A wrong gap law goes together with the parameters that make up for it.
    """
    here = simulated.Parameters(result.parameters, result.beyond)
    p = Problem(result.parameters, result.names, result.drives, beyond=result.beyond)
    pars, moves, found = [parameters_at(p, x) for x in STEP * np.eye(len(p.names))], result.law_moves, list[float]()
    plain = result.covariance - moves @ moves.T
    for one, places, model in zip(result.drives, result.places, result.models):
        moved = sample_record(pars, one, places, "position")
        slopes = (moved - model.position) / STEP
        variance = np.einsum("jt,jk,kt->t", slopes, plain, slopes)
        if moves.size:
            positions = partial(sample_record, drive=one, places=places, name="position")
            by_law = law_errors(here, positions)
            variance += ((by_law + moves.T @ slopes) ** 2).sum(axis=0)
        found.append(float(np.mean(variance)))
    return math.sqrt(max(found))


def doubt(p: Problem) -> float:
    """Of the resistance, relative: what a converter hides of a voltage that is held, and places that are all wrong."""
    found = []
    for one in p.drives:
        v, jumps = one.record.voltage, np.abs(np.diff(one.halves[one.edges], axis=1)).sum()
        places = 0.0 if p.is_alike else BIASED * float(jumps / np.abs(one.halves.mean(axis=1)).sum())
        found.append(math.hypot(rounding(v) / float(np.abs(v).max()), places))
    return max(found)


def usual(p: Problem) -> float:
    """Cost that noise and error of the model make, as `Mhe` takes it, and the places of edges."""
    error = (LEFT * float(p.known.model_error)) ** 2
    costs = [1.5 * (d.noise**2 + error) * float(d.weights @ d.weights) + d.edges.size for d in p.drives]
    return float(sum(costs))


def with_bend(par: Parameters) -> Parameters:
    """The same device with the bend of the core as a parameter of its own."""
    par = par._replace(core_exponent=0.0)
    d, area = device(par), par.coil_turns**2
    core = {"core_reluctance": d.core * area, "core_bend": d.knee * area / d.saturation}
    return par._replace(**core, core_saturation=d.saturation)


def is_fitted(par: Parameters, name: str) -> bool:
    """What is zero stays zero, and a gap law in a file has a factor only."""
    has_fringe = par.gap_law == GapLaw.fringing and par.gap_fringing > 0.0
    return bool(getattr(par, name) > 0.0 and (has_fringe or name not in ("gap_fringing", "gap_window")))


def validate(par: Parameters, record: Record, beyond: Beyond = USUAL) -> Validation:
    """The model beside a record; only offsets and the places of edges are sought."""
    driven = read_excitation(record, par)
    p = Problem(par, [], [driven], beyond=beyond)
    x = minimise(p, np.zeros(p.deviations.size), LONGEST, ENOUGH).point
    return Validation(record, simulate(par, driven, p.places(x)[0], p.offsets(x)[0], beyond), driven.first)
