"""Small matrices of scalars."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense.linalg import deviation, diagonal, gain, identity, matrix, outer, symmetric, vector


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
    np.testing.assert_array_equal(gain(vector([2.0, 4.0]), 4.0), [0.5, 1.0])
    for S in (0.0, -1e-30):
        np.testing.assert_array_equal(gain(vector([2.0, 4.0]), S), [0.0, 0.0])


@pytest.mark.parametrize(("variance", "expected"), [(4.0, 2.0), (0.0, 0.0), (-1e-20, 0.0)])
def test_deviation_of_a_variance_that_rounding_made_negative_is_zero(variance: float, expected: float) -> None:
    assert deviation(variance) == expected
