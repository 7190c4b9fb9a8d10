"""Damped Gauss-Newton steps: several dampings are tried at once, for that costs no more than one."""

from __future__ import annotations

import math

import numpy as np

from gapsense.identification.actuator.problem import Matrix, Problem
from gapsense.identification.measurements.record import Vector

LONGEST = 25  # Jacobians
DAMPINGS = (0.0, 0.01, 0.1, 1.0, 10.0, 100.0, 1e3)  # of steps, in deviations of what is believed
ENOUGH = 1e-5  # relative fall of the cost with which it ends
FURTHEST = math.log(10.0)  # of a logarithm; 1 for places and offsets


def minimised(p: Problem, x: Vector) -> Vector:
    """The minimum next to a point."""
    (r,) = p.residuals([x])
    for _ in range(LONGEST):
        points = candidates(p, x, p.jacobian(x), r)
        tried = p.residuals(points)
        costs = [float(t @ t) for t in tried]
        best, before = int(np.argmin(costs)), float(r @ r)
        if costs[best] >= before:
            break
        x, r = points[best], tried[best]
        if costs[best] > (1.0 - ENOUGH) * before:
            break
    return x


def candidates(p: Problem, x: Vector, J: Matrix, r: Vector) -> list[Vector]:
    """Where Gauss-Newton steps with different dampings lead."""
    H, g, scale = J.T @ J, J.T @ r, np.diag(p.deviations**-2)
    steps = [np.linalg.solve(H + damping * scale, g) for damping in DAMPINGS]
    limits = np.append(np.full(len(p.names), FURTHEST), np.ones(x.size - len(p.names)))
    return [np.clip(x - step, -limits, limits) for step in steps]
