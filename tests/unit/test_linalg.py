"""Small matrices of scalars."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense.kernels.linalg import (
    deviation,
    diagonal,
    identity,
    ldl,
    matrix,
    nonnegative,
    outer,
    pivot,
    solve,
    symmetric,
    vector,
)


def test_constructors_equal_numpy() -> None:
    a, b = vector([1.0, 2.0]), vector([3.0, 4.0])
    np.testing.assert_array_equal(outer(a, b), np.outer([1.0, 2.0], [3.0, 4.0]))
    np.testing.assert_array_equal(diagonal([1.0, 2.0]), np.diag([1.0, 2.0]))
    np.testing.assert_array_equal(identity(3), np.eye(3))
    np.testing.assert_array_equal(matrix([[1.0, 2.0], [3.0, 4.0]]) @ a, [5.0, 11.0])


def test_products_hold_plain_floats() -> None:
    assert {type(v) for v in (identity(2) @ vector([1.0, 2.0]))} == {float}


def test_symmetric_mirrors_the_upper_triangle() -> None:
    np.testing.assert_array_equal(symmetric(matrix([[1.0, 2.0], [9.0, 3.0]])), [[1.0, 2.0], [2.0, 3.0]])


def test_gain_is_zero_without_information() -> None:
    np.testing.assert_array_equal(vector([2.0, 4.0]) / pivot(4.0), [0.5, 1.0])
    for S in (0.0, -1e-30):
        np.testing.assert_array_equal(vector([2.0, 4.0]) / pivot(S), [0.0, 0.0])


@pytest.mark.parametrize(("variance", "expected"), [(4.0, 2.0), (0.0, 0.0), (-1e-20, 0.0)])
def test_deviation_of_a_variance_that_rounding_made_negative_is_zero(variance: float, expected: float) -> None:
    assert deviation(variance) == expected


def test_factors_give_the_matrix_back_and_solve_with_zero_pivots() -> None:
    rng = np.random.default_rng(1)
    for rank in (0, 1, 2, 4):
        root = np.array([[1e6], [1.0], [1e-6], [1e-3]]) * rng.standard_normal((4, rank))
        P, B = root @ root.T, root @ rng.standard_normal((rank, 2))
        L, D = ldl(matrix(P.tolist()))
        assert sum(d < np.inf for d in D) == rank
        X = solve((L, D), matrix(B.tolist()))
        np.testing.assert_allclose(
            (P @ np.array(X, float)) / [[1e6], [1.0], [1e-6], [1e-3]], B / [[1e6], [1.0], [1e-6], [1e-3]], atol=1e-9
        )


def test_no_variance_is_negative_and_none_is_divided_by_when_zero() -> None:
    np.testing.assert_array_equal(nonnegative(matrix([[-1e-20, 2.0], [9.0, 3.0]])), [[0.0, 0.0], [0.0, 3.0]])
    assert [1.0 / pivot(S) for S in (2.0, 0.0, -1.0)] == [0.5, 0.0, 0.0]
