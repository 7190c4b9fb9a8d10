"""All parameters of `Mhe` from records of voltage and current: least squares over whole records, from rest.

Coil and core come first, from the first quarter of each record; then all parameters, from its first half and from the
whole of it: far from the minimum a long record is wrong by whole motions, and says little.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.estimators.mhe.model import Parameters, device
from gapsense.estimators.reduced_model import GapLaw
from gapsense.identification.actuator.drive import LEFT, Drive, drive
from gapsense.identification.actuator.minimise import minimised
from gapsense.identification.actuator.problem import BESIDE, DEVIATIONS, STEP, Matrix, Problem, changed, simulate
from gapsense.identification.actuator.verdict import residual
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.noise import rounding
from gapsense.identification.residual import Residual
from gapsense.identification.valve.model import Trajectory

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
    drives: Sequence[Drive]
    places: Sequence[Vector]  # of the edges of each record, in sampling periods after the middle
    models: Sequence[Trajectory]
    residuals: Sequence[Residual]  # of the currents that count
    believed: Mapping[str, float]  # how wrong what was believed may have been, by field

    @property
    def errors(self) -> dict[str, float]:
        """Relative standard errors by field."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))

    @property
    def is_explained(self) -> bool:
        """Whether the model explains all records, and these tell when the voltage switched."""
        return all(r.is_explained for r in self.residuals) and not any(d.is_too_fast for d in self.drives)

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
    drives = [drive(record, known) for record in records]
    par, doubts = bent(known), doubts or {}
    names = [name for name in dict.fromkeys((*DEVIATIONS, *doubts)) if is_fitted(par, name)]
    every = Problem(par, names, drives, doubts=doubts)
    x = np.zeros(every.deviations.size)
    for k, share in enumerate(SHARES):
        progress(k, len(SHARES) + 1)
        free = [j for j, name in enumerate(names) if k or name in ELECTRIC]
        part = every._replace(names=[names[j] for j in free], drives=[d.shortened(share) for d in drives])
        at = np.array([*free, *sought(drives, part.drives, len(names))])
        x[at] = minimised(part, x[at])
    progress(len(SHARES), len(SHARES) + 1)
    return concluded(*in_step(every, x))


def in_step(p: Problem, x: Vector) -> tuple[Problem, Vector]:
    """The same with edges that all lie alike, unless places of their own explain more than by chance."""
    alike, at = p._replace(is_alike=True), x.copy()
    for columns in p.columns:
        at[columns.start + BESIDE : columns.stop] = 0.0
    at = minimised(alike, at)
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


def sought(drives: Sequence[Drive], parts: Sequence[Drive], first: int) -> list[int]:
    """Where the places of edges in the first parts of records are among all that is sought."""
    found = list[int]()
    for whole, part in zip(drives, parts):
        found += range(first, first + BESIDE + part.edges.size)
        first += BESIDE + whole.edges.size
    return found


def concluded(p: Problem, x: Vector) -> Commissioned:
    """What a minimum says."""
    J, (r,) = p.jacobian(x), p.residuals([x])
    n, places, found = len(p.names), p.places(x), changed(p, x)
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
    )


def position_error(result: Commissioned) -> float:
    """What the standard errors of all parameters do to the position of the model, RMS in the worst record [m]."""
    return max(_position_error(result, *of_record) for of_record in zip(result.drives, result.places, result.models))


def _position_error(result: Commissioned, one: Drive, places: Vector, model: Trajectory) -> float:
    p = Problem(result.parameters, result.names, [one])
    steps = STEP * np.eye(len(p.names))
    slopes = [(simulate(changed(p, step), one, places).position - model.position) / STEP for step in steps]
    return float(np.sqrt(np.mean(np.einsum("jt,jk,kt->t", slopes, result.covariance, slopes))))


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


def bent(par: Parameters) -> Parameters:
    """The same device with the bend of the core as a parameter of its own."""
    d, area = device(par), par.coil_turns**2
    core = {"core_reluctance": d.core * area, "core_bend": d.knee * area / d.saturation}
    return par._replace(**core, core_saturation=d.saturation)


def is_fitted(par: Parameters, name: str) -> bool:
    """What is zero stays zero, and a gap law in a file has a factor only."""
    return bool(getattr(par, name) > 0.0 and (name != "gap_fringing" or par.gap_law == GapLaw.fringing))
