"""The unscented transformation against Monte Carlo, exact moments and singular covariances."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.estimators.kalman import Gaussian
from gapsense.estimators.ukf import columns, condition_on_last, moments, pair
from gapsense.kernels.linalg import vector

SPREADS = (3.0, 5.0, 8.0, 20.0)


def transformed(function: Any, estimate: Gaussian, spread: float) -> Gaussian:
    """Mean and covariance of `function(x)` for a Gaussian x."""
    x, P = estimate
    centre = function(x)
    pairs = [pair(centre, function(x + c), function(x - c)) for c in columns(P, spread)]
    return moments(centre, pairs, spread)


def gaussian(seed: int, n: int = 3, rank: int | None = None, size: float = 1.0) -> tuple[Gaussian, Any, Any]:
    rng = np.random.default_rng(seed)
    root = size * rng.standard_normal((n, n if rank is None else rank))
    mean, cov = rng.standard_normal(n), root @ root.T
    return Gaussian(np.array(mean, object), np.array(cov, object)), mean, root


def smooth(x: Any) -> Any:
    return vector([x[0] + 0.2 * x[0] * x[1] + 0.3 * x[2], 1.0 / (9.0 + x[0]), 2.0 * x[1] + 0.1 * x[1] * x[1] - x[2]])


@cache
def drawn(seed: int, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, deviation and correlation of `smooth` over draws of the Gaussian of a seed."""
    _, mean, root = gaussian(seed, size=0.05)
    x = mean[:, None] + root @ np.random.default_rng(100 + seed).standard_normal((3, samples))
    y = np.array(list(smooth(x)), float)
    return y.mean(axis=1), y.std(axis=1), np.corrcoef(y)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("spread", SPREADS)
def test_moments_of_a_smooth_function_are_those_of_monte_carlo(seed: int, spread: float) -> None:
    """Mean to the third order, covariance to the second: what is left of the difference is chance."""
    samples = 400_000
    average, std, correlation = drawn(seed, samples)
    found = transformed(smooth, gaussian(seed, size=0.05)[0], spread)
    deviation = (np.array(found.mean, float) - average) / std
    assert np.abs(deviation).max() < 5.0 / np.sqrt(samples)
    cov = np.array(found.cov, float) / np.outer(std, std)
    assert np.abs(cov - correlation).max() < 5.0 * np.sqrt(2.0 / samples) + 0.02


@pytest.mark.parametrize("spread", SPREADS)
def test_mean_of_a_quadratic_is_exact(spread: float) -> None:
    """E x'Ax = m'Am + tr(A P), which a linearisation misses."""
    estimate, mean, root = gaussian(7)
    A = np.random.default_rng(8).standard_normal((3, 3))
    found = transformed(lambda x: vector([x @ A @ x]), estimate, spread).mean[0]
    assert found == pytest.approx(mean @ A @ mean + np.trace(A @ root @ root.T), rel=1e-12)


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
@pytest.mark.parametrize("order", [None, (2, 0, 1), (1, 2, 0)])
def test_columns_make_the_covariance_again_also_a_singular_one(rank: int, order: Any) -> None:
    estimate, _, root = gaussian(3, rank=rank)
    made = np.array(columns(estimate.cov, 8.0, order), float).T
    np.testing.assert_allclose(made @ made.T, 8.0 * root @ root.T, atol=1e-12)
    if order is not None:
        for k, column in enumerate(made.T):
            assert np.all(column[list(order[:k])] == 0.0)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([0, 1, 2, 3, 4]), st.sampled_from([4.0, 8.0, 30.0]))
def test_covariance_is_symmetric_and_non_negative_for_any_function(seed: int, rank: int, spread: float) -> None:
    estimate, _, _ = gaussian(seed, 4, rank)
    B = np.random.default_rng(seed).standard_normal((4, 4))

    def rough(x: Any) -> Any:
        return vector([min(max(v, -0.5), 0.2) if k % 2 else abs(v) for k, v in enumerate(B @ x)])

    cov = np.array(transformed(rough, estimate, spread).cov, float)
    np.testing.assert_array_equal(cov, cov.T)
    assert np.linalg.eigvalsh(cov).min() >= -1e-12 * max(1.0, np.abs(cov).max())


def test_condition_on_last_is_that_of_a_joint_gaussian() -> None:
    joint, mean, root = gaussian(5, 4)
    P, R, y = root @ root.T, 0.3, 1.7
    K = P[:3, 3] / (P[3, 3] + R)
    found = condition_on_last(joint, y - mean[3], R)
    np.testing.assert_allclose(np.array(found.mean, float), mean[:3] + K * (y - mean[3]), rtol=1e-13)
    np.testing.assert_allclose(np.array(found.cov, float), P[:3, :3] - np.outer(K, P[3, :3]), atol=1e-13)


def test_what_is_certain_tells_nothing() -> None:
    certain = Gaussian(vector([1.0, 2.0]), np.array([[0.5, 0.0], [0.0, 0.0]], object))
    assert list(condition_on_last(certain, 3.0, 0.0).mean) == [1.0]


def test_moments_of_clipped_points_stay_in_the_bounds() -> None:
    pairs = [pair([0.9], [1.0], [0.5]), pair([0.9], [0.95], [0.7])]
    found = moments(vector([0.9]), pairs, 8.0)
    weights = np.array([1 - 2 / 8, 1 / 16, 1 / 16, 1 / 16, 1 / 16])
    points = np.array([0.9, 1.0, 0.5, 0.95, 0.7])
    assert found.mean[0] == pytest.approx(weights @ points, rel=1e-14)
    assert found.cov[0, 0] == pytest.approx(weights @ (points - weights @ points) ** 2, rel=1e-12)
