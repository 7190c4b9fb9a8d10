"""The unscented transformation: sigma points and their moments, for any estimator.

A Gaussian of n dimensions becomes 2 n + 1 points, its mean and mean +- a column of a square root of `spread` P, with
`spread` = n + kappa.  The weight of a pair is 1 / (2 spread), that of the mean 1 - n / spread: kappa / (n + kappa).
With spread >= n no weight is negative, and neither is a covariance made from them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gapsense.estimators.kalman import Gaussian
from gapsense.linalg import ldl, matrix, pivot, vector
from gapsense.records import Array, Scalar
from gapsense.trace import sqrt, where


def square_root(P: Array) -> Array:
    """Lower triangle C with C C' = P from the factors L D L'; a column without information is zero."""
    L, D = ldl(P)
    return L * vector([sqrt(where(d < math.inf, d, 0.0)) for d in D])


def sigma_points(estimate: Gaussian, spread: Scalar, order: Sequence[int] | None = None) -> list[Array]:
    """The mean, then the pairs mean + column, mean - column.

    Parameters
    ----------
    estimate : Gaussian
        Mean (n,) and covariance (n, n), which may be singular.
    spread : scalar
        n + kappa, positive.
    order : sequence of int, optional
        Order in which the components are eliminated.  Column k leaves the first k of them where they are, so that a
        function that is costly in one component should have it first: fewer points then differ in it.
    """
    x, P = estimate
    order = order or range(len(x))
    C = square_root(matrix([[P[i, j] for j in order] for i in order])) * sqrt(spread)
    points = [x]
    for column in C.T:
        offset = vector([0.0] * len(x))
        offset[list(order)] = column
        points += [x + offset, x - offset]
    return points


def moments(points: Sequence[Array], spread: Scalar) -> Gaussian:
    """Weighted mean and covariance of sigma points, or of what a function has made of them.

    With e the points' offsets from the first one, and b their weighted sum: mean x_0 + b, covariance sum w e e' - b b'.
    """
    weight = 0.5 / spread
    centre, *others = points
    pairs = [(a - centre, b - centre) for a, b in zip(others[::2], others[1::2])]
    b = weight * sum(up + down for up, down in pairs)
    n = len(centre)
    cov = matrix([[0.0] * n for _ in range(n)])
    for i in range(n):
        for j in range(i, n):
            products = sum(up[i] * up[j] + down[i] * down[j] for up, down in pairs)
            cov[i, j] = cov[j, i] = weight * products - b[i] * b[j]
    return Gaussian(centre + b, cov)


def condition_on_last(joint: Gaussian, innovation: Scalar, R: Scalar) -> Gaussian:
    """Estimate of all but the last component, given that this was measured with noise of variance `R`.

    K = P_xy / (P_yy + R), mean x + K innovation, covariance P - K (P_yy + R) K'.  [UKF] Algorithm 3, with minus.
    """
    x, P = joint.mean[:-1], joint.cov[:-1, :-1]
    c = joint.cov[:-1, -1]
    K = c / pivot(joint.cov[-1, -1] + R)
    n = len(x)
    cov = matrix([[P[i, j] - K[min(i, j)] * c[max(i, j)] for j in range(n)] for i in range(n)])
    return Gaussian(x + K * innovation, cov)
