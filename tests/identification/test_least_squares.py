"""Damped Gauss-Newton steps within bounds, on problems whose minima are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from gapsense.identification.least_squares import differences, minimise, promise


class Residuals(NamedTuple):
    of: Callable[[np.ndarray], np.ndarray]
    high: float = 10.0
    slopes: float = 1.0  # of the Jacobian, where it is wrong
    scale: np.ndarray | None = None

    @property
    def limits(self):
        return np.full(2, -self.high), np.full(2, self.high)

    def residuals(self, points):
        return np.array([self.of(x) for x in points])

    def jacobian(self, point, at=None):
        return self.slopes * differences(self.residuals, point, self.high, at)


VALLEY = Residuals(lambda x: np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]))  # H. H. Rosenbrock 1960


def test_a_curved_valley_is_followed_to_its_lowest_point():
    found = minimise(VALLEY, np.array([-1.2, 1.0]), 100)
    np.testing.assert_allclose(found.point, [1.0, 1.0], atol=1e-6)
    assert found.steps > 1
    with_lengths = minimise(VALLEY._replace(scale=np.array([0.1, 0.1])), np.array([-1.2, 1.0]), 100)
    np.testing.assert_allclose(with_lengths.point, [1.0, 1.0], atol=1e-6)


def test_what_is_pushed_against_a_limit_stays_there():
    found = minimise(VALLEY._replace(high=0.5), np.array([-0.4, 0.4]), 100)
    np.testing.assert_allclose(found.point, [0.5, 0.25], atol=1e-4)
    assert found.point[0] == 0.5


def test_a_number_without_effect_stays_where_it_is():
    found = minimise(Residuals(lambda x: np.array([x[0] - 3.0, 2.0 * x[0]])), np.array([1.0, 0.7]))
    np.testing.assert_allclose(found.point, [0.6, 0.7], atol=1e-9)


def test_where_usual_dampings_raise_the_cost_larger_ones_are_tried():
    """Slopes that are 1e-4 of the true ones make steps that are 1e4 times too long."""
    wrong = Residuals(lambda x: np.arctan(x), slopes=1e-4)
    assert np.abs(minimise(wrong, np.array([1.0, -1.0]), 200).point).max() < 1e-3


def test_promise_tells_a_minimum_from_a_point_that_is_none():
    at = np.array([1.0, 1.0])
    assert promise(VALLEY, at, VALLEY.jacobian(at), VALLEY.of(at)) == 0.0
    far = np.array([-1.2, 1.0])
    assert promise(VALLEY, far, VALLEY.jacobian(far), VALLEY.of(far)) == pytest.approx(1.0)
