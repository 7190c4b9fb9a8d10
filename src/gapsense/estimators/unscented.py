"""The unscented transformation: sigma points and their moments, for any estimator.

A Gaussian of n dimensions becomes 2 n + 1 points, its mean and mean +- a column of a square root of `spread` P, with
`spread` = n + kappa.  The weight of each point of a pair is 1 / (2 spread), that of the mean 1 - n / spread, which is
kappa / (n + kappa).  With spread >= n no weight is negative, and neither is a covariance made from them.

A pair is kept as half its difference and as its mean's distance from the centre.  What is the same at both points, or
lies on a straight line through the centre, then costs nothing where the code is generated.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from gapsense.estimators.kalman import Gaussian
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import ldl, matrix, pivot, total, vector
from gapsense.kernels.trace import sqrt, where


class Pair(NamedTuple):
    """Two points centre + even + odd and centre + even - odd."""

    odd: Array
    even: Array


def columns(P: Array, spread: Scalar, order: Sequence[int] | None = None) -> list[Array]:
    """Columns (n,) of a square root of `spread` P, from its factors L D L'; one without information is zero.

    Parameters
    ----------
    P : (n, n) array
        Covariance, which may be singular.
    spread : scalar
        n + kappa, positive.
    order : sequence of int, optional
        Order in which the components are eliminated.  The column with index k leaves the first k of them where they
        are, so that one in which a function is costly should come first: fewer points then differ in it.
    """
    order = order or range(len(P))
    L, D = ldl(matrix([[P[i, j] for j in order] for i in order]))
    made = []
    for column, d in zip(L.T, D):
        made.append(vector([0.0] * len(P)))
        made[-1][list(order)] = column * sqrt(where(d < math.inf, d, 0.0) * spread)
    return made


def pair(centre: Iterable[Scalar], up: Iterable[Scalar], down: Iterable[Scalar]) -> Pair:
    """The pair of points `up` and `down` around `centre`."""
    parts = [_parts(*values) for values in zip(centre, up, down)]
    return Pair(*(vector(values) for values in zip(*parts)))


def _parts(centre: Scalar, up: Scalar, down: Scalar) -> tuple[Scalar, Scalar]:
    if up is centre and down is centre:
        return 0.0, 0.0
    return 0.5 * (up - down), 0.5 * (up + down) - centre


def moments(centre: Array, pairs: Sequence[Pair], spread: Scalar) -> Gaussian:
    """Weighted mean and covariance of the points, exact up to the third power of what made them from a Gaussian.

    With b the sum of weighted offsets: mean centre + b, covariance sum w (odd odd' + even even') - b b'.
    """
    weight = 1.0 / spread
    b = weight * total(even for _, even in pairs)
    n = len(centre)
    cov = matrix([[0.0] * n for _ in range(n)])
    for i in range(n):
        for j in range(i, n):
            products = total(odd[i] * odd[j] + even[i] * even[j] for odd, even in pairs)
            cov[i, j] = cov[j, i] = weight * products - b[i] * b[j]
    return Gaussian(centre + b, cov)


def condition_on_last(joint: Gaussian, innovation: Scalar, R: Scalar) -> Gaussian:
    """Estimate of all but the last component, given that this was measured with noise of variance `R`.

    K = P_xy / (P_yy + R), mean x + K innovation, covariance P - K (P_yy + R) K'.  [UKF] Algorithm 3, with minus.
    """
    x, P, c = joint.mean[:-1], joint.cov[:-1, :-1], joint.cov[:-1, -1]
    K = c / pivot(joint.cov[-1, -1] + R)
    n = len(x)
    cov = matrix([[P[i, j] - K[min(i, j)] * c[max(i, j)] for j in range(n)] for i in range(n)])
    return Gaussian(x + K * innovation, cov)
