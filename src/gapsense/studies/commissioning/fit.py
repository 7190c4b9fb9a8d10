"""All parameters of `Mhe` from one record of voltage and current: least squares over the whole record, from rest.

Sought are the logarithms of factors of what is believed, each with a deviation that says how wrong that may be: they
make the cost sum w^2 (i - i_model)^2 + sum (log factor / deviation)^2, with the weights of `Mhe`.  Coil and core come
first, from the first quarter of the record; then all parameters, from its first half and from the whole of it: far
from the minimum a long record is wrong by whole motions, and says little.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gapsense.estimators.mhe import JUMP, Parameters, weight
from gapsense.estimators.mhe_model import device
from gapsense.estimators.reduced_model import GapLaw
from gapsense.kernel import Kernel
from gapsense.lanes import is_compiled, stepped
from gapsense.records import flat
from gapsense.studies.commissioning import device as simulated
from gapsense.studies.records.record import Record, Vector
from gapsense.workers import Progress

DEVIATIONS = {  # of the logarithms: how wrong what is believed may be
    "coil_resistance": 0.15,
    "core_eddy": 1.0,
    "core_reluctance": 0.4,
    "core_bend": 0.4,
    "core_saturation": 0.06,
    "core_hysteresis": 1.0,
    "core_turnover": 0.7,
    "gap_factor": 0.04,
    "gap_fringing": 0.1,
    "mover_mass": 0.04,
    "spring_stiffness": 0.04,
    "spring_rest": 0.04,
    "damping": 0.05,
}
ELECTRIC = {name for name in DEVIATIONS if name.startswith(("coil", "core")) and name != "core_turnover"}
SHARES = (0.25, 0.5, 1.0)  # of the record that is used, one after the other
STEP, LONGEST = 1e-5, 25  # of a difference quotient; Jacobians per share
FURTHEST = math.log(10.0)
KERNEL = Kernel(simulated)

Matrix = npt.NDArray[np.float64]


class Trajectory(NamedTuple):
    """What the model does at the samples of a record."""

    current: Vector  # [A]
    position: Vector  # [m]


class Commissioned(NamedTuple):
    """What was found, and how well."""

    parameters: Parameters  # complete set
    names: list[str]  # fields that were fitted
    covariance: Matrix  # of their logarithms
    misfit: float  # cost of the currents over what noise and error of the model make
    model: Trajectory

    @property
    def errors(self) -> dict[str, float]:
        """Relative standard errors by field."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))


class Problem(NamedTuple):
    """The cost, for some of the parameters and the first samples of a record."""

    known: Parameters
    names: list[str]
    voltage: list[float]
    current: Vector
    weights: Vector  # w

    def residuals(self, logs: Vector) -> Vector:
        """Their squares add up to the cost; values far from any device give large ones instead of NaN."""
        return self.of_current(logs, simulate(changed(self, logs), self.voltage).current)

    def of_current(self, logs: Vector, current: Vector) -> Vector:
        """The residuals, if this is the current of the model."""
        off = self.weights * (self.current - current)
        return np.nan_to_num(np.append(off, logs / deviations(self.names)), nan=1e3, posinf=1e3, neginf=-1e3)

    def jacobian(self, logs: Vector) -> Matrix:
        """Derivatives of the residuals."""
        points = logs + STEP * np.eye(logs.size + 1, logs.size, -1)  # the first one is where it is
        found = currents([changed(self, point) for point in points], self.voltage)
        at, *others = map(self.of_current, points, found)
        return np.array([(other - at) / STEP for other in others]).T


def commission(record: Record, known: Parameters, progress: Progress = lambda done, total: None) -> Commissioned:
    """Parameters that explain a record, near those that are known."""
    par = bent(known._replace(sample_time=record.dt))
    names = [name for name in DEVIATIONS if is_fitted(par, name)]
    logs = np.zeros(len(names))
    for k, share in enumerate(SHARES):
        progress(k, len(SHARES))
        free = [j for j, name in enumerate(names) if k or name in ELECTRIC]
        logs[free] = minimised(problem(record, par, [names[j] for j in free], share), logs[free])
    whole = problem(record, par, names)
    J, found = whole.jacobian(logs), changed(whole, logs)
    misfit = float(np.sum(whole.residuals(logs)[: -len(names)] ** 2)) / usual(whole)
    covariance: Matrix = max(1.0, misfit) * np.linalg.inv(J.T @ J).astype(np.float64)
    return Commissioned(found, names, covariance, misfit, simulate(found, whole.voltage))


def bent(par: Parameters) -> Parameters:
    """The same device with the bend of the core as a parameter of its own."""
    d, area = device(par), par.coil_turns**2
    core = {"core_reluctance": d.core * area, "core_bend": d.knee * area / d.saturation}
    return par._replace(**core, core_saturation=d.saturation)


def is_fitted(par: Parameters, name: str) -> bool:
    """What is zero stays zero, and a gap law in a file has a factor only."""
    return bool(getattr(par, name) > 0.0 and (name != "gap_fringing" or par.gap_law == GapLaw.fringing))


def problem(record: Record, par: Parameters, names: list[str], share: float = 1.0) -> Problem:
    """The cost of a record; the current counts where it does in `Mhe`."""
    n = round(share * record.voltage.size)
    u, i = record.voltage[:n], record.current[:n]
    is_edge = np.abs(np.diff(u, prepend=u[0])) > par.edge + JUMP * par.noise_voltage
    return Problem(par, names, u.tolist(), i, np.where(is_edge, 0.0, math.sqrt(weight(par))))


def minimised(p: Problem, logs: Vector) -> Vector:
    """The minimum next to a point."""
    limits = (-FURTHEST, FURTHEST)
    found = least_squares(p.residuals, logs, p.jacobian, limits, x_scale=deviations(p.names), max_nfev=LONGEST)
    return np.asarray(found.x)


def usual(p: Problem) -> float:
    """Cost that noise and error of the model make, as `Mhe` takes it."""
    variance = float(p.known.noise_current) ** 2 + float(p.known.model_error) ** 2
    return 1.5 * variance * float(p.weights @ p.weights)


def deviations(names: Collection[str]) -> Vector:
    """How wrong what is believed may be."""
    return np.array([DEVIATIONS[name] for name in names])


def changed(p: Problem, logs: Vector) -> Parameters:
    """What is known, multiplied by factors."""
    factors = zip(p.names, np.exp(logs).tolist())
    return p.known._replace(**{name: getattr(p.known, name) * factor for name, factor in factors})


def currents(pars: list[Parameters], voltage: list[float]) -> Matrix:
    """Currents of several models, (models, samples); in scalar Python where numpy would be slower."""
    if not is_compiled(KERNEL, len(voltage), ("current",)):
        return np.array([simulate(par, voltage).current for par in pars])
    columns = [v[0] if isinstance(v[0], list) else np.array(v) for v in zip(*map(flat, pars))]
    return stepped(KERNEL, np.reshape(voltage, (-1, 1, 1)), columns, ("current",))[:, 0].T


def simulate(par: Parameters, voltage: list[float]) -> Trajectory:
    """The model from rest on, at each sample."""
    scalar, values = KERNEL.scalar, flat(par)
    constants, advance = scalar["constants"](values), scalar["advance"]
    state, outputs = scalar["initial"]((voltage[0],), values)
    rows = [outputs]
    for u in voltage[1:]:
        state, outputs = advance(state, (u,), constants)
        rows.append(outputs)
    return Trajectory(*np.array(rows).T)
