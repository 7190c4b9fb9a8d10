"""Small matrices of scalars, traced or not, and the only ways in which this project inverts a covariance.

Arrays have dtype object: products then add up in a fixed order and give the same bits as generated code, which BLAS
does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import reduce
from operator import add, and_
from typing import Any

import numpy as np

from gapsense.kernels.trace import cond, is_traced, sqrt, where

ROUNDING = 1e-13  # share of a variance below which the rest is only rounding


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


def total(items: Iterable[Any]) -> Any:
    """Sum in the order of the items; Python's own corrects its rounding since 3.12, which generated code does not."""
    return reduce(add, items, 0.0)


def symmetric(P: Any) -> Any:
    """Matrix with the upper triangle of `P` mirrored, so that rounding cannot make it asymmetric."""
    n = len(P)
    return matrix([[P[min(i, j), max(i, j)] for j in range(n)] for i in range(n)])


def outer(a: Any, b: Any) -> Any:
    """Product a b' (m, n)."""
    return matrix([[x * y for y in b] for x in a])


def sweep(A: Any) -> Any:
    """Sweep the first row and column of a symmetric positive definite matrix, and move them to the end.

    After as many turns as it has rows, the result is minus its inverse, with the rows in their old order.
    """
    p, row = pivot(A[0, 0]), A[0, 1:]
    rest = A[1:, 1:] - outer(row, row / p)
    return matrix([*([*r, x] for r, x in zip(rest, row / p)), [*(row / p), -1.0 / p]])


def nonnegative(P: Any) -> Any:
    """Covariance with the upper triangle of `P`; what rounding has made a negative variance is zero, with its row."""
    positive = [variance > 0.0 for variance in P.diagonal()]
    P = _without_zero_variances(
        symmetric(P), [is_traced(p) or p for p in positive]
    )  # what is known while tracing costs nothing
    return cond(
        reduce(and_, filter(is_traced, positive), True), lambda: P, lambda: _without_zero_variances(P, positive)
    )


def _without_zero_variances(P: Any, positive: Sequence[Any]) -> Any:
    """Covariance without the rows and columns of variances that are not positive."""
    pairs = [[p if p is q else p & q for q in positive] for p in positive]
    return symmetric(matrix([[where(c, v, 0.0) for c, v in zip(*row)] for row in zip(pairs, P)]))


def pivot(S: Any, floor: Any = 0.0) -> Any:
    """Divisor `S`; infinite unless it is above `floor`: no information in this direction, and a gain of zero."""
    return where(S > floor, S, math.inf)  # noqa: SIM300


def ldl(P: Any) -> tuple[Any, Any]:
    """Factors of P = L D L' for a covariance (n, n): unit lower triangle L, and D (n,) with infinity for a zero pivot.

    A pivot is zero if all but `ROUNDING` of the variance is explained by the directions before it.
    """
    n = len(P)
    L, C, D = identity(n), identity(n), vector([0.0] * n)  # C = L D, also where a pivot is zero
    for j in range(n):
        for i in range(j, n):
            C[i, j] = P[i, j] - total(C[i, k] * L[j, k] for k in range(j))
        D[j] = pivot(C[j, j], ROUNDING * P[j, j] if j else 0.0)
        L[j + 1 :, j] = C[j + 1 :, j] / D[j]
    return L, D


def solve(factors: tuple[Any, Any], B: Any) -> Any:
    """X = P^- B from the factors of `ldl`, with a generalised inverse of P: P X = B wherever that can be solved."""
    L, D = factors
    X, n = B + 0.0, len(D)
    for i in range(n):
        for k in range(i):
            X[i] = X[i] - L[i, k] * X[k]
    for i in reversed(range(n)):
        X[i] = X[i] / D[i]
        for k in range(i + 1, n):
            X[i] = X[i] - L[k, i] * X[k]
    return X


def deviation(variance: Any) -> Any:
    """Standard deviation; zero where rounding has made the variance negative."""
    return sqrt(where(variance > 0.0, variance, 0.0))
