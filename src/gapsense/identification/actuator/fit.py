"""All parameters of `Mhe` from records of voltage and current: least squares over whole records, from rest.

Sought are the logarithms of factors of what is believed, each with a deviation that says how wrong that may be, and the
places of the edges: sum w^2 (i - i_model)^2 + sum (log factor / deviation)^2 + sum (place / deviation)^2.  Coil and
core come first, from the first quarter of each record; then all parameters, from its first half and from the whole of
it: far from the minimum a long record is wrong by whole motions, and says little.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.estimators.mhe.model import Parameters, device
from gapsense.estimators.reduced_model import GapLaw
from gapsense.identification.actuator import kernel as simulated
from gapsense.identification.actuator.drive import ALIKE, ANYWHERE, LEFT, Excitation, read_excitation
from gapsense.identification.least_squares import STEP, Matrix, Vector, currents, finite, minimise, promise
from gapsense.identification.measurements.record import Record
from gapsense.identification.residual import EXPLAINED, Residual, rounding
from gapsense.identification.residual import residual as of_all
from gapsense.identification.show import Validation, compare
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
        return {name: self.doubts[name] if name in self.doubts else DEVIATIONS[name] for name in self.names}

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
        high = np.append([furthest(name) for name in self.names], np.ones(places))
        return -high, high

    def residuals(self, points: Sequence[Vector]) -> Matrix:
        """For each of some points: their squares add up to the cost, with large ones instead of NaN."""
        pars, found = [parameters_at(self, x) for x in points], []
        for k, drive in enumerate(self.drives):
            volts = np.stack([drive.voltage(self.places(x)[k]) for x in points], axis=1)
            offsets = np.array([[self.offsets(x)[k]] for x in points])
            found.append(drive.weights * (drive.current - offsets - sampled_currents(pars, drive, volts)))
        return finite(np.hstack([*found, np.array(points) / self.deviations]))

    def jacobian(self, x: Vector) -> Matrix:
        """Derivatives of the residuals."""
        free, row = len(self.names), 0
        J = np.zeros((sum(d.current.size for d in self.drives) + x.size, x.size))
        pars = [parameters_at(self, x), *(parameters_at(self, x + STEP * e) for e in np.eye(free, x.size))]
        for drive, places, columns in zip(self.drives, self.places(x), self.columns):
            rows = slice(row, row := row + drive.current.size)
            J[rows, :free], J[rows, columns] = slopes(pars, drive, places)
        J[row:] = np.diag(1.0 / self.deviations)
        return finite(J)


def slopes(pars: Sequence[Parameters], drive: Excitation, places: Vector) -> tuple[Matrix, Matrix]:
    """Derivatives of the residuals of a record: by logarithms, then by its offset, all places together, and each."""
    by = np.where(places > 0.0, -PLACE_STEP, PLACE_STEP)  # inwards
    volts = np.repeat(drive.voltage(places)[:, None], len(pars), axis=1)
    models = [*pars, *[pars[0]] * places.size]
    at, *others = -drive.weights * sampled_currents(models, drive, np.hstack([volts, drive.moved(places, by)]))
    off = (np.array(others) - at).T
    each = off[:, len(pars) - 1 :] / by
    return off[:, : len(pars) - 1] / STEP, np.hstack([-drive.weights[:, None], each.sum(axis=1, keepdims=True), each])


def parameters_at(p: Problem, x: Vector) -> Parameters:
    """What is known, multiplied by factors."""
    factors = zip(p.names, np.exp(x[: len(p.names)]).tolist())
    return p.known._replace(**{name: getattr(p.known, name) * factor for name, factor in factors})


def sampled_currents(pars: Sequence[Parameters], drive: Excitation, volts: Matrix) -> Matrix:
    """Currents of several models at the samples, (models, samples); `volts` are those of each, (steps, models)."""
    every = np.vstack([np.zeros((1, len(pars))), volts])
    pars = [par._replace(sample_time=drive.step) for par in pars]
    return currents(KERNEL, pars, every[:, None, :])[:, :: drive.parts]


def simulate(par: Parameters, drive: Excitation, places: Vector, offset: float = 0.0) -> Trajectory:
    """The model at each sample of a record, with the offset that its current has."""
    rows = run(par._replace(sample_time=drive.step), [0.0, *drive.voltage(places).tolist()])[:: drive.parts]
    current, flux_linkage, position = rows.T
    return Trajectory(current + offset, flux_linkage, position)


def run(par: Parameters, volts: list[float]) -> Matrix:
    """Current, flux linkage and position after each step with its mean voltage; the first row is the start, at rest."""
    return np.array(KERNEL.run([(u,) for u in volts], par)[1])


LONGEST, ENOUGH = 25, 1e-5  # steps, and relative fall of the cost with which they end
FURTHEST, GUESSED = math.log(10.0), math.log(1000.0)  # of a logarithm, and of one of losses; 1 for places and offsets
NEAR = 0.999  # part of it that is at the limit
PROMISES = 0.1  # part of the cost, by which a minimum is none


def furthest(name: str) -> float:
    """How far the logarithm of a field may go: losses are guesses, up to solid cores."""
    return GUESSED if DEVIATIONS.get(name, 0.0) >= 1.0 else FURTHEST


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


ELECTRIC = {name for name in DEVIATIONS if name.startswith(("coil", "core")) and name != "core_turnover"}
BIASED = 0.03  # sampling periods by which the rising edges may be found later than the falling ones
CHANCE = 2.0  # squares that a number explains without meaning (AIC)
SHARES = (0.25, 0.5, 1.0)  # of each record that is used, one after the other


class Commissioned(NamedTuple):
    """What was found, and how well."""

    parameters: Parameters  # complete set
    names: list[str]  # fields that were fitted
    covariance: Matrix  # of their logarithms
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
        """Relative standard errors by field."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))

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

    `doubts` are the deviations of fields that were assumed: they are sought with all else, for what is as uncertain
    makes all that goes with it uncertain.
    """
    drives = [read_excitation(record, known) for record in records]
    par, doubts = with_bend(known), doubts or {}
    names = [name for name in dict.fromkeys((*DEVIATIONS, *doubts)) if is_fitted(par, name)]
    every = Problem(par, names, drives, doubts=doubts)
    x, steps = np.zeros(every.deviations.size), 0
    for k, share in enumerate(SHARES):
        progress(k, len(SHARES) + 1)
        free = [j for j, name in enumerate(names) if k or name in ELECTRIC]
        part = every._replace(names=[names[j] for j in free], drives=[d.shortened(share) for d in drives])
        at = np.array([*free, *places_sought(drives, part.drives, len(names))])
        found = minimise(part, x[at], LONGEST, ENOUGH)
        x[at], steps = found.point, steps + found.steps
    progress(len(SHARES), len(SHARES) + 1)
    return conclude(*in_step(every, x), steps)


def in_step(p: Problem, x: Vector) -> tuple[Problem, Vector]:
    """The same with edges that all lie alike, unless places of their own explain more than by chance."""
    alike, at = p._replace(is_alike=True), x.copy()
    for columns in p.columns:
        at[columns.start + BESIDE : columns.stop] = 0.0
    at = minimise(alike, at, LONGEST, ENOUGH).point
    after, before = (unexplained(p, point) for point in (at, x))
    edges = sum(d.edges.size for d in p.drives)
    return (alike, at) if after - before < CHANCE * edges else (p, x)


def unexplained(p: Problem, x: Vector) -> float:
    """Squares of what is left of the currents, in noises."""
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
    covariance: Matrix = max(1.0, misfit) * np.linalg.inv(J.T @ J).astype(np.float64)[:n, :n]
    covariance[0, 0] += doubt(p) ** 2  # the resistance is the first
    models = [simulate(found, *of_record) for of_record in zip(p.drives, places, p.offsets(x))]
    residuals = [residual(d, model, p.known.model_error) for d, model in zip(p.drives, models)]
    return Commissioned(
        parameters=found,
        names=p.names,
        covariance=covariance,
        misfit=misfit,
        drives=p.drives,
        places=places,
        models=models,
        residuals=residuals,
        believed=p.believed,
        steps=steps,
        promise=promise(p, x, J, r),
        at_limit=[name for name, ratio in zip(p.names, x.tolist()) if abs(ratio) > NEAR * furthest(name)],
    )


def position_error(result: Commissioned) -> float:
    """What the standard errors of all parameters do to the position of the model, RMS in the worst record [m]."""
    p, found = Problem(result.parameters, result.names, result.drives), []
    pars = [parameters_at(p, step) for step in STEP * np.eye(len(p.names))]
    for one, places, model in zip(result.drives, result.places, result.models):
        slopes = [(simulate(par, one, places).position - model.position) / STEP for par in pars]
        found.append(np.mean(np.einsum("jt,jk,kt->t", slopes, result.covariance, slopes)))
    return float(np.sqrt(max(found)))


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
    d, area = device(par), par.coil_turns**2
    core = {"core_reluctance": d.core * area, "core_bend": d.knee * area / d.saturation}
    return par._replace(**core, core_saturation=d.saturation)


def is_fitted(par: Parameters, name: str) -> bool:
    """What is zero stays zero, and a gap law in a file has a factor only."""
    return bool(getattr(par, name) > 0.0 and (name != "gap_fringing" or par.gap_law == GapLaw.fringing))


def validate_actuator(par: Parameters, records: Sequence[Record]) -> list[Validation]:
    """The model beside each of some records; only offsets and the places of edges are sought."""
    return [validate(par, record) for record in records]


def validate(par: Parameters, record: Record) -> Validation:
    """Beside one of them."""
    driven = read_excitation(record, par)
    p = Problem(par, [], [driven])
    x = minimise(p, np.zeros(p.deviations.size), LONGEST, ENOUGH).point
    return compare(record, simulate(par, driven, p.places(x)[0], p.offsets(x)[0]), driven.first)
