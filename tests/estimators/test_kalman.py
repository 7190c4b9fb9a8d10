"""The shared steps of the Kalman estimators against textbook formulas and batch conditioning of Gaussians."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from batch_gaussian import batch
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.estimators.kalman import Gaussian, condition, predict, project, smooth
from gapsense.kernels.linalg import matrix, vector

SEEDS = st.integers(0, 10**6)


def numbers(array: Any) -> np.ndarray:
    return np.array(array, float)


def objects(array: np.ndarray) -> Any:
    return vector(array.tolist()) if array.ndim == 1 else matrix(array.tolist())


def covariance(rng: np.random.Generator, n: int, rank: int) -> np.ndarray:
    """Random covariance of the given rank; the states are scaled over eight decades."""
    root = 10.0 ** rng.uniform(-4, 4, (n, 1)) * rng.standard_normal((n, rank))
    return root @ root.T


def is_covariance(P: Any, before: Any, tolerance: float = 1e-9) -> bool:
    """Symmetric and, with the states scaled by what was before, without an eigenvalue clearly below zero."""
    values, scale = numbers(P), np.sqrt(np.maximum(np.diag(numbers(before)), 1e-300))
    scaled = values / np.outer(scale, scale)
    return bool(
        np.array_equal(values, values.T)
        and np.all(np.diag(values) >= 0.0)
        and np.linalg.eigvalsh(scaled).min() >= -tolerance * max(1.0, np.abs(scaled).max())
    )


@settings(max_examples=100)
@given(SEEDS, st.integers(1, 5), st.integers(1, 3))
def test_condition_equals_the_textbook(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    P, H, R = covariance(rng, n, n), rng.standard_normal((m, n)), rng.uniform(0.1, 2.0, m)
    P /= np.abs(P).max()
    x, innovation = rng.standard_normal(n), rng.standard_normal(m)
    found = condition(Gaussian(objects(x), objects(P)), objects(innovation), objects(H), objects(R))
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(R))
    np.testing.assert_allclose(numbers(found.mean), x + K @ innovation, atol=1e-11)
    np.testing.assert_allclose(numbers(found.cov), P - K @ H @ P, atol=1e-12)


@settings(max_examples=200)
@given(SEEDS, st.integers(2, 5), st.integers(0, 5), st.sampled_from([0.0, 1e-12, 1.0]))
def test_covariances_stay_symmetric_and_non_negative(seed: int, n: int, rank: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    P = covariance(rng, n, min(rank, n))
    scale = np.sqrt(np.diag(P)) + 1e-8
    H = rng.standard_normal((2, n)) * rng.integers(0, 2, (2, n)) / scale
    prior = Gaussian(objects(rng.standard_normal(n)), objects(P))
    posterior = condition(prior, objects(rng.standard_normal(2)), objects(H), vector([noise, 0.0]))
    assert is_covariance(posterior.cov, P)
    F, Q = rng.standard_normal((n, n)) * np.outer(scale, 1.0 / scale), covariance(rng, n, 1)
    ahead = Gaussian(objects(F) @ posterior.mean, predict(posterior.cov, objects(F), objects(Q)))
    assert is_covariance(ahead.cov, F @ P @ F.T + Q)
    later = condition(ahead, objects(rng.standard_normal(1)), objects(rng.standard_normal((1, n))), vector([noise]))
    smoothed = smooth(posterior, ahead, objects(F), objects(Q), later)
    assert np.all(np.diag(numbers(smoothed.cov)) >= 0.0)
    assert np.all(np.isfinite(numbers(smoothed.cov)))


def test_measurement_without_noise_is_met_exactly() -> None:
    P = covariance(np.random.default_rng(3), 4, 4)
    prior = Gaussian(objects(np.arange(4.0)), objects(P))
    found = condition(prior, vector([7.0]), matrix([[0.0, 1.0, 0.0, 0.0]]), vector([0.0]))
    assert np.all(found.cov[1] == 0.0) and found.mean[1] == 8.0
    again = condition(found, vector([5.0]), matrix([[0.0, 1.0, 0.0, 0.0]]), vector([0.0]))
    np.testing.assert_array_equal(again.mean, found.mean)
    np.testing.assert_array_equal(again.cov, found.cov)


def test_rows_that_repeat_each_other_say_nothing_new() -> None:
    rng = np.random.default_rng(4)
    P, h = covariance(rng, 3, 3), rng.standard_normal(3)
    prior = Gaussian(objects(np.zeros(3)), objects(P))
    once = condition(prior, vector([1.0]), objects(h[None]), vector([0.0]))
    thrice = condition(prior, vector([1.0, 2.0, 0.5]), objects(np.array([h, 2 * h, 0.5 * h])), vector([0.0] * 3))
    np.testing.assert_allclose(numbers(thrice.mean), numbers(once.mean), rtol=1e-12)


def test_projection_is_the_most_likely_point_of_the_interval() -> None:
    P = covariance(np.random.default_rng(5), 3, 3)
    x = np.array([1.5, -2.0, 3.0])
    found = project(Gaussian(objects(x), objects(P)), 0, 0.0, 1.0)
    np.testing.assert_allclose(numbers(found.mean), x + P[:, 0] / P[0, 0] * (1.0 - 1.5), rtol=1e-12)
    assert found.mean[0] == 1.0
    inside = project(found, 0, 0.0, 1.0)
    np.testing.assert_array_equal(inside.mean, found.mean)
    known = project(Gaussian(objects(x), matrix([[0.0] * 3] * 3)), 0, 0.0, 1.0)
    np.testing.assert_array_equal(known.mean, [1.0, -2.0, 3.0])


def forward_backward(x0: Any, P0: Any, Fs: Any, Q: Any, Hs: Any, R: Any, ys: Any) -> list[Gaussian]:
    """The same by filter and smoother."""
    estimate = Gaussian(objects(x0), objects(P0))
    filtered, predicted = [], []
    for k, (H, r, y) in enumerate(zip(Hs, R, ys)):
        if k:
            F = objects(Fs[k - 1])
            estimate = Gaussian(F @ estimate.mean, predict(estimate.cov, F, objects(Q)))
            predicted.append(estimate)
        estimate = condition(estimate, objects(y - H @ numbers(estimate.mean)), objects(H), objects(r))
        filtered.append(estimate)
    smoothed = [filtered[-1]]
    for k in reversed(range(len(Fs))):
        smoothed.insert(0, smooth(filtered[k], predicted[k], objects(Fs[k]), objects(Q), smoothed[0]))
    return smoothed


@pytest.mark.parametrize("rank", [0, 1, 3], ids=["known start", "line", "full"])
@pytest.mark.parametrize("noise", [0.0, 0.1], ids=["exact rows", "noisy rows"])
@pytest.mark.parametrize("seed", range(4))
def test_smoother_equals_batch_conditioning(seed: int, rank: int, noise: float) -> None:
    """Also with a singular start, process noise in one state only and measurements without noise."""
    rng = np.random.default_rng(seed)
    n, N = 3, 7
    root = rng.standard_normal((n, rank))
    P0 = root @ root.T
    Fs = [np.eye(n) + 0.3 * rng.standard_normal((n, n)) for _ in range(N - 1)]
    Q = np.diag([0.0, 0.0, 0.5])
    Hs = [rng.standard_normal((1 + (k in (0, N - 1)), n)) for k in range(N)]
    R = [np.array([0.2, noise])[: len(h)] for h in Hs]
    x = root @ rng.standard_normal(rank)  # consistent with what is known exactly
    ys = []
    for k, (h, r) in enumerate(zip(Hs, R)):
        x = x if k == 0 else Fs[k - 1] @ x + np.array([0.0, 0.0, np.sqrt(0.5) * rng.standard_normal()])
        ys.append(h @ x + np.sqrt(r) * rng.standard_normal(len(r)))
    means, covariances = batch(np.zeros(n), P0, Fs, Q, Hs, R, ys)
    found = forward_backward(np.zeros(n), P0, Fs, Q, Hs, R, ys)
    for estimate, mean, P in zip(found, means, covariances):
        np.testing.assert_allclose(numbers(estimate.mean), mean, atol=1e-9)
        np.testing.assert_allclose(numbers(estimate.cov), P, atol=1e-9)
