"""Least squares for coil, valve and actuator: damped Gauss-Newton steps within bounds, and the errors that follow.

To simulate several models at once costs hardly more than one.  So Jacobians are made by differences, and several
dampings of a step are tried at once (K. Levenberg 1944, D. Marquardt 1963); if all of them raise the cost, larger ones.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import is_compiled, step_runs
from gapsense.kernels.layout import flat

Vector = npt.NDArray[np.float64]
Matrix = npt.NDArray[np.float64]

STEP = 1e-5  # of a difference quotient, of a logarithm
DAMPINGS = ((0.0, 0.01, 0.1, 1.0, 10.0, 100.0, 1e3), (1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10))  # the second if need be
NEGLIGIBLE = 1e-12  # eigenvalue, relative to the largest, of a direction without effect
FAR = 1e3  # residual of what is no device


class Problem(Protocol):
    """What is minimised: the sum of the squares of its residuals."""

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Lowest and highest point."""

    @property
    def scale(self) -> Vector | None:
        """Lengths by which steps are damped; None: by what the residuals tell."""

    def residuals(self, points: Sequence[Vector]) -> Matrix:
        """Of several points (points, residuals)."""

    def jacobian(self, point: Vector, at: Vector | None = None, /) -> Matrix:
        """Derivatives of the residuals (residuals, point); `at` are those of the point, where they are known."""


class Minimum(NamedTuple):
    """Where the steps end."""

    point: Vector
    residuals: Vector
    steps: int  # that lowered the cost


def sample_outputs(kernel: Kernel, pars: Sequence[Any], inputs: Matrix, name: str = "current") -> Matrix:
    """Currents, or another output, of several models with inputs of their own (samples, inputs, models).

    They are (models, samples).
    """
    if not is_compiled(kernel, len(inputs), (name,)):
        place = kernel.module.Outputs._fields.index(name)
        runs = [kernel.run(inputs[:, :, k].tolist(), par)[1] for k, par in enumerate(pars)]
        return np.array([[row[place] for row in run] for run in runs])
    columns = [
        v[0] if isinstance(v[0], list) and v.count(v[0]) == len(v) else np.array(v).T for v in zip(*map(flat, pars))
    ]
    return np.asarray(step_runs(kernel, inputs, columns, (name,))[:, 0].T)


def differences(
    values: Callable[[list[Vector]], Matrix], x: Vector, high: Vector | float = np.inf, at: Vector | None = None
) -> Matrix:
    """Derivatives of values (points, n) at a point by difference quotients, within the highest point; (n, x.size).

    `at` are the values of the point itself (n,), where they are known.
    """
    steps = steps_within(x, high)
    here = [x] if at is None else []
    found = values([*here, *(x + np.diag(steps))])
    return quotients(found[0] if at is None else at, found[len(here) :], steps)


def steps_within(x: Vector, high: Vector | float) -> Vector:
    """Of difference quotients at a point, within the highest point."""
    return np.where(x + STEP > high, -STEP, STEP)


def quotients(here: Vector, beside: Matrix, steps: Vector) -> Matrix:
    """Derivatives from the values of a point (n,), and those after each of some steps (steps, n); (n, steps)."""
    return np.asarray(((beside - here) / steps[:, None]).T)


def finite(x: Vector) -> Vector:
    """Replace NaN and infinity, which models far from any device give, by large numbers."""
    return x if np.isfinite(x).all() else np.nan_to_num(x, nan=FAR, posinf=FAR, neginf=-FAR)


def minimise(p: Problem, start: Vector, longest: int = 50, enough: float = 1e-8) -> Minimum:
    """The minimum next to a point.

    Parameters
    ----------
    p : Problem
        What is minimised.
    start : (n,) array
        Where the steps begin.
    longest : int
        Steps at most.
    enough : float
        Relative fall of the cost with which they end.
    """
    search: Descent = descend(p, start, longest, enough)
    answer: Matrix | None = None
    while True:
        try:
            points, known = search.send(answer)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        answer = p.residuals(points) if known is None else p.jacobian(points[0], known)


# Points, for their residuals; or one point with its residuals, for their derivatives.
Asked: TypeAlias = "tuple[list[Vector], Vector | None]"
Descent: TypeAlias = Generator[Asked, Any, Minimum]


def descend(p: Problem, start: Vector, longest: int, enough: float) -> Descent:
    """The way to the minimum next to a point, which asks for what it needs of the residuals; see `minimise`."""
    x, taken = np.clip(start, *p.limits), 0
    (r,) = yield [x], None
    while taken < longest and (found := (yield from _lower(p, x, r))) is not None:
        before, (x, r), taken = float(r @ r), found, taken + 1
        if float(r @ r) > (1.0 - enough) * before:
            break
    return Minimum(x, r, taken)


def _lower(p: Problem, x: Vector, r: Vector) -> Generator[Asked, Any, tuple[Vector, Vector] | None]:
    """The best point of several dampings, with its residuals; None if all of them raise the cost."""
    J = yield [x], r
    for dampings in DAMPINGS:
        points = candidates(p, x, J, r, dampings)
        tried = yield points, None
        costs = np.einsum("ij,ij->i", tried, tried)
        best = int(np.argmin(costs))
        if costs[best] < r @ r:
            return points[best], tried[best]
    return None


def promise(p: Problem, x: Vector, J: Matrix, r: Vector) -> float:
    """Part by which the cost would fall with the next step, if the residuals were straight; 0 at a minimum."""
    (after,) = candidates(p, x, J, r, (0.0,))
    left, cost = r + J @ (after - x), float(r @ r)
    return 1.0 - float(left @ left) / cost if cost else 0.0


def candidates(p: Problem, x: Vector, J: Matrix, r: Vector, dampings: Sequence[float]) -> list[Vector]:
    """Where Gauss-Newton steps with different dampings lead; what is at a limit and pushed against it stays there."""
    (low, high), g = p.limits, J.T @ r
    free = ~(((x <= low) & (g > 0.0)) | ((x >= high) & (g < 0.0)))
    A = J[:, free]
    H = A.T @ A
    D = np.sqrt(np.maximum(np.diag(H), 1e-300)) if p.scale is None else 1.0 / p.scale[free]
    sizes, directions = np.linalg.eigh(H / np.outer(D, D))
    along = directions.T @ (g[free] / D)
    least = NEGLIGIBLE * float(sizes.max(initial=0.0)) + 1e-300
    damped = sizes + np.array(dampings)[:, None]
    by = np.where(damped > least, along / np.maximum(damped, least), 0.0)
    points = np.tile(x, (len(dampings), 1))
    points[:, free] -= np.stack([directions @ each for each in by]) / D
    return [*np.clip(points, low, high)]


def long_run(W: Matrix, r: Vector) -> Matrix:
    """Covariance of the sum of W[:, k] r[k] for stationary r, with Bartlett's taper over n^(1/3) lags.

    More lags would see the correlation that the fit itself gives to the residuals, and find too little variance.
    """
    lags = int(np.cbrt(r.size))
    cov = float(r @ r) / r.size * (W @ W.T)
    for h in range(1, lags):
        part = (1.0 - h / lags) * float(r[h:] @ r[:-h]) / r.size * (W[:, h:] @ W[:, :-h].T)
        cov = cov + part + part.T
    return cov


def independent(r: Vector) -> float:
    """Number of independent samples among residuals; their autocorrelation counts until it is negative."""
    time, square = 1.0, float(r @ r) or 1.0
    for lag in range(1, r.size // 2):
        rho = float(r[lag:] @ r[:-lag]) / square
        if rho <= 0.0:
            break
        time += 2.0 * rho
    return r.size / time


def square(x: Vector) -> float:
    """Sum of squares."""
    return float(x @ x)


def rms(x: Vector) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(x**2)))
