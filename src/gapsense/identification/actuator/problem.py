"""The cost of parameters: what they leave of the currents of some records, and how far they are from what is believed.

Sought are the logarithms of factors of what is believed, each with a deviation that says how wrong that may be, and the
places of the edges: sum w^2 (i - i_model)^2 + sum (log factor / deviation)^2 + sum (place / deviation)^2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.estimators.mhe.model import Parameters
from gapsense.identification.actuator import device as simulated
from gapsense.identification.actuator.drive import ALIKE, ANYWHERE, Drive
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.model import Trajectory
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import is_compiled, stepped
from gapsense.kernels.layout import flat

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
STEP, PLACE_STEP = 1e-5, 1e-3  # of difference quotients
FEW = 24  # models that scalar Python steps faster than numpy
BESIDE = 2  # numbers that a record has beside the places of its edges: offset, and what these share
KERNEL = Kernel(simulated)

Matrix = npt.NDArray[np.float64]


class Problem(NamedTuple):
    """The cost, for some of the parameters and the first part of some records."""

    known: Parameters
    names: list[str]
    drives: Sequence[Drive]
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

    def residuals(self, points: Sequence[Vector]) -> list[Vector]:
        """For each of some points: their squares add up to the cost, with large ones instead of NaN."""
        pars, found = [changed(self, x) for x in points], []
        for k, drive in enumerate(self.drives):
            volts = np.stack([drive.voltage(self.places(x)[k]) for x in points], axis=1)
            offsets = np.array([[self.offsets(x)[k]] for x in points])
            found.append(drive.weights * (drive.current - offsets - currents(pars, drive, volts)))
        return [
            finite(np.concatenate([*(rows[j] for rows in found), x / self.deviations])) for j, x in enumerate(points)
        ]

    def jacobian(self, x: Vector) -> Matrix:
        """Derivatives of the residuals."""
        free, row = len(self.names), 0
        J = np.zeros((sum(d.current.size for d in self.drives) + x.size, x.size))
        pars = [changed(self, x), *(changed(self, x + STEP * e) for e in np.eye(free, x.size))]
        for drive, places, columns in zip(self.drives, self.places(x), self.columns):
            rows = slice(row, row := row + drive.current.size)
            J[rows, :free], J[rows, columns] = slopes(pars, drive, places)
        J[row:] = np.diag(1.0 / self.deviations)
        return finite(J)


def slopes(pars: Sequence[Parameters], drive: Drive, places: Vector) -> tuple[Matrix, Matrix]:
    """Derivatives of the residuals of a record: by logarithms, then by its offset, all places together, and each."""
    by = np.where(places > 0.0, -PLACE_STEP, PLACE_STEP)  # inwards
    volts = np.repeat(drive.voltage(places)[:, None], len(pars), axis=1)
    models = [*pars, *[pars[0]] * places.size]
    at, *others = -drive.weights * currents(models, drive, np.hstack([volts, drive.moved(places, by)]))
    off = (np.array(others) - at).T
    each = off[:, len(pars) - 1 :] / by
    return off[:, : len(pars) - 1] / STEP, np.hstack([-drive.weights[:, None], each.sum(axis=1, keepdims=True), each])


def finite(x: Matrix) -> Matrix:
    """Values far from any device give large numbers instead of NaN."""
    return np.nan_to_num(x, nan=1e3, posinf=1e3, neginf=-1e3)


def changed(p: Problem, x: Vector) -> Parameters:
    """What is known, multiplied by factors."""
    factors = zip(p.names, np.exp(x[: len(p.names)]).tolist())
    return p.known._replace(**{name: getattr(p.known, name) * factor for name, factor in factors})


def currents(pars: Sequence[Parameters], drive: Drive, volts: Matrix) -> Matrix:
    """Currents of several models at the samples, (models, samples); `volts` are those of each, (steps, models)."""
    every = np.vstack([np.zeros((1, len(pars))), volts])
    pars = [par._replace(sample_time=drive.step) for par in pars]
    if not is_compiled(KERNEL, len(every), ("current",)) and len(pars) <= FEW:
        return np.array([run(par, u.tolist())[:, 0] for par, u in zip(pars, every.T)])[:, :: drive.parts]
    columns = [v[0] if isinstance(v[0], list) else np.array(v) for v in zip(*map(flat, pars))]
    return stepped(KERNEL, every[:, None, :], columns, ("current",))[:: drive.parts, 0].T


def simulate(par: Parameters, drive: Drive, places: Vector, offset: float = 0.0) -> Trajectory:
    """The model at each sample of a record, with the offset that its current has."""
    rows = run(par._replace(sample_time=drive.step), [0.0, *drive.voltage(places).tolist()])[:: drive.parts]
    current, flux_linkage, position = rows.T
    return Trajectory(current + offset, flux_linkage, position)


def run(par: Parameters, volts: list[float]) -> Matrix:
    """Current, flux linkage and position after each step with its mean voltage; the first row is the start, at rest."""
    scalar, values = KERNEL.scalar, flat(par)
    constants, advance = scalar["constants"](values), scalar["advance"]
    state, outputs = scalar["initial"]((volts[0],), values)
    rows = [outputs]
    for u in volts[1:]:
        state, outputs = advance(state, (u,), constants)
        rows.append(outputs)
    return np.array(rows)
