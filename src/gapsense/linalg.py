"""Small matrices of scalars, traced or not, and the only ways in which this project inverts a covariance.

Arrays have dtype object: products then add up in a fixed order and give the same bits as generated code, which BLAS
does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gapsense.trace import sqrt, where


def vector(items: Sequence[Any]) -> Any:
    """Vector (n,) of scalars."""
    return np.array([*items], dtype=object)


def matrix(rows: Sequence[Sequence[Any]]) -> Any:
    """Matrix (m, n) of scalars."""
    return np.array([[*row] for row in rows], dtype=object)


def diagonal(items: Sequence[Any]) -> Any:
    """Diagonal matrix (n, n)."""
    return matrix([[item if i == j else 0.0 for j in range(len(items))] for i, item in enumerate(items)])


def identity(n: int) -> Any:
    """Unit matrix (n, n)."""
    return diagonal([1.0] * n)


def symmetric(P: Any) -> Any:
    """Matrix with the upper triangle of `P` mirrored, so that rounding cannot make it asymmetric."""
    n = len(P)
    return matrix([[P[min(i, j), max(i, j)] for j in range(n)] for i in range(n)])


def outer(a: Any, b: Any) -> Any:
    """Product a b' (m, n)."""
    return matrix([[x * y for y in b] for x in a])


def gain(PH: Any, S: Any) -> Any:
    """Kalman gain PH / S of a scalar measurement; zero where S is zero: no information in this direction."""
    is_positive = S > 0.0
    return PH * where(is_positive, 1.0 / where(is_positive, S, 1.0), 0.0)


def deviation(variance: Any) -> Any:
    """Standard deviation; zero where rounding has made the variance negative."""
    return sqrt(where(variance > 0.0, variance, 0.0))
