"""Least squares of a form: logarithms of its parameters, and the offsets that the converters of the records hide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gapsense.identification.coil import device
from gapsense.identification.coil.device import Outputs, Parameters
from gapsense.identification.coil.forms import Form, Scale, ranges, without_parts
from gapsense.identification.coil.runs import Run
from gapsense.identification.measurements.record import Vector
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import is_compiled, stepped
from gapsense.kernels.layout import flat

KERNEL = Kernel(device)
STEP, LONGEST = 1e-5, 60  # of a difference quotient; Jacobians
AT_LIMIT = 1e-3  # of the range of a logarithm
FAR = 1e3  # residual of what is no coil

Matrix = npt.NDArray[np.float64]


class Problem(NamedTuple):
    """The cost of a form; a point is the logarithms, then offsets in parts of what is hidden."""

    form: Form
    scale: Scale
    runs: Sequence[Run]

    @property
    def offsets(self) -> list[tuple[int, int]]:
        """Run and signal of each offset."""
        return [(k, j) for k, run in enumerate(self.runs) for j, most in enumerate(run.hidden) if most > 0.0]

    def limits(self) -> Matrix:
        """Lowest point, start and highest point."""
        of_form = [ranges(self.scale)[name] for name in self.form.names]
        logs = np.log([[r.low, r.start, r.high] for r in of_form]).T
        return np.hstack((logs, np.tile([[-1.0], [0.0], [1.0]], len(self.offsets))))

    def parameters(self, point: Vector, run: Run) -> Parameters:
        """The device of a point."""
        logs = point[: len(self.form.names)]
        found = dict(zip(self.form.names, np.exp(logs).tolist()))
        return without_parts(self.scale, run.record.dt)._replace(**found)

    def offset(self, point: Vector, k: int) -> tuple[float, float]:
        """Offsets of voltage and current in a run."""
        found = dict(zip(self.offsets, point[len(self.form.names) :].tolist()))
        voltage, current = (found.get((k, j), 0.0) * most for j, most in enumerate(self.runs[k].hidden))
        return voltage, current

    def models(self, points: Sequence[Vector], k: int) -> Matrix:
        """Currents that each point gives in a run, as they would be measured (points, samples)."""
        run = self.runs[k]
        offsets = np.array([self.offset(point, k) for point in points])
        voltages: Matrix = run.voltages[:, :, None] + offsets[:, 0]
        return np.asarray(currents([self.parameters(point, run) for point in points], voltages) + offsets[:, 1:])

    def residuals(self, points: Sequence[Vector]) -> Matrix:
        """Residuals over the noise (points, samples of all runs)."""
        parts = [(run.current - self.models(points, k)) / run.noise for k, run in enumerate(self.runs)]
        return np.nan_to_num(np.concatenate(parts, axis=1), nan=FAR, posinf=FAR, neginf=-FAR)

    def jacobian(self, point: Vector) -> Matrix:
        """Derivatives of the residuals, by models that are simulated together."""
        steps = np.where(point + STEP > self.limits()[2], -STEP, STEP)
        at, *others = self.residuals([point, *(point + np.diag(steps))])
        return np.array([(other - at) / step for other, step in zip(others, steps)]).T


class Minimum(NamedTuple):
    """Where a form fits best."""

    problem: Problem
    point: Vector
    residuals: Vector  # over the noise, of all runs

    @property
    def held(self) -> npt.NDArray[np.bool_]:
        """Of each parameter and offset, whether it ends at a limit."""
        low, _, high = self.problem.limits()
        margin = AT_LIMIT * (high - low)
        return np.asarray((self.point < low + margin) | (self.point > high - margin))

    @property
    def power(self) -> float:
        """Sum of the squares of the residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def rms(self) -> float:
        """Of the residuals."""
        return float(np.sqrt(self.power / self.residuals.size))

    def parts(self) -> list[Vector]:
        """Residuals of each run over its noise."""
        return np.split(self.residuals, np.cumsum([run.current.size for run in self.problem.runs])[:-1])


def minimum(problem: Problem, start: Vector | None = None) -> Minimum:
    """The minimum next to the usual start, or to a point."""
    low, usual, high = problem.limits()
    found = least_squares(
        lambda x: problem.residuals([x])[0],
        usual if start is None else np.clip(start, low, high),
        problem.jacobian,
        (low, high),
        x_scale=0.1,
        tr_solver="lsmr",
        max_nfev=LONGEST,
    )
    return Minimum(problem, np.asarray(found.x), np.asarray(found.fun))


def currents(pars: Sequence[Parameters], voltages: Matrix) -> Matrix:
    """Currents of several coils with voltages of their own (samples, 3, coils); (coils, samples)."""
    if not is_compiled(KERNEL, len(voltages), ("current",)):
        return np.array([simulate(par, voltages[:, :, k])[:, 0] for k, par in enumerate(pars)])
    return stepped(KERNEL, voltages, [*np.array(pars).T], ("current",))[:, 0].T


def simulate(par: Parameters, voltages: Matrix) -> Matrix:
    """Outputs of one coil from rest on (samples, outputs)."""
    scalar, values = KERNEL.scalar, flat(par)
    constants, advance = scalar["constants"](values), scalar["advance"]
    first, *others = map(tuple, voltages.tolist())
    state, outputs = scalar["initial"](first, values)
    rows = [outputs]
    for inputs in others:
        state, outputs = advance(state, inputs, constants)
        rows.append(outputs)
    return np.array(rows).reshape(-1, len(Outputs._fields))
