"""The steps that every Kalman-type estimator shares: predict, condition, project, smooth.

They take exactly singular covariances: a direction without uncertainty is a zero pivot, divided by as if it were
infinite, and so without gain.  No absolute jitter is added anywhere: variances here span eighteen decades.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import ROUNDING, identity, ldl, nonnegative, outer, pivot, solve, symmetric
from gapsense.kernels.trace import clip, cond, square, where


class Gaussian(NamedTuple):
    """An estimate: mean (n,) and covariance (n, n)."""

    mean: Array
    cov: Array


def predict(P: Array, F: Array, Q: Array) -> Array:
    """Covariance of F x + w: F P F' + Q, [RTS] (33)."""
    return nonnegative(F @ symmetric(P) @ F.T + Q)


def condition(prior: Gaussian, innovation: Array, H: Array, R: Array) -> Gaussian:
    """Estimate given the measurement H x + v; `R` (m,) are the variances of uncorrelated noises, which may be zero.

    Row by row: K = P H' / (H P H' + R), where the divisors are the pivots of the LDL' factorisation of the innovation's
    covariance; a row whose pivot is zero says nothing new.  A row without noise leaves variances of exactly zero.  The
    covariance is that of Joseph, A P A' + K R K' with A = I - K H.  [RTS] (34)-(36).
    """
    x, P = prior
    for k, (h, r) in enumerate(zip(H, R)):
        Ph = P @ h
        S = h @ Ph + r
        K = Ph / pivot(S, ROUNDING * (h @ prior.cov @ h + r) if k else 0.0)
        x = x + K * (innovation[k] - h @ (x - prior.mean) if k else innovation[k])
        AP = P - outer(K, Ph)
        P = nonnegative(AP - outer(AP @ h - K * r, K))
    return Gaussian(x, P)


def fix(prior: Gaussian, k: int, value: Scalar) -> Gaussian:
    """Estimate given x_k = value without noise: its variance is then exactly zero; if it was, x_k is replaced."""
    x, P = prior
    K = P[:, k] / pivot(P[k, k])
    mean, cov = x + K * (value - x[k]), P - outer(K, P[k])
    mean[k] = value
    cov[k, :] = cov[:, k] = 0.0
    return Gaussian(mean, cov)


def project(estimate: Gaussian, k: int, low: Scalar, high: Scalar) -> Gaussian:
    """Most likely estimate with low <= x_k <= high; the covariance is kept, which is cautious, [RTS] (39)-(42)."""
    x, P = estimate

    def projected() -> Array:
        bound = clip(x[k], low, high)
        moved = x + P[:, k] / pivot(P[k, k]) * (bound - x[k])
        moved[k] = bound
        return moved

    return Gaussian(cond((x[k] >= low) & (x[k] <= high), lambda: x, projected), P)


def smooth(filtered: Gaussian, predicted: Gaussian, F: Array, Q: Array, later: Gaussian) -> Gaussian:
    """One backward step of Rauch, Tung and Striebel: `filtered` improved by the smoothed estimate of the next sample.

    G = P F' P_pred^-, mean x + G (x_later - x_pred), covariance P + G (P_later - P_pred) G', [RTS] (44)-(46).
    `predicted` and `F` are those of the filter; P_pred^- is a generalised inverse.  With A = I - G F the covariance is
    written A P A' + G (Q + P_later) G', a sum of which no part is negative.
    """
    P = filtered.cov
    G = solve(ldl(predicted.cov), F @ P).T
    A: Any = identity(len(P)) - G @ F
    mean = filtered.mean + G @ (later.mean - predicted.mean)
    return Gaussian(mean, nonnegative(A @ P @ A.T + G @ (Q + later.cov) @ G.T))


def surprise(before: Scalar, innovation: Scalar, std: Scalar, samples: Scalar) -> Scalar:
    """Mean of the squared normalised innovation over about so many samples; its expected value is 1."""
    return mean(before, square(normalise(innovation, std)), samples)


def normalise(innovation: Scalar, std: Scalar) -> Scalar:
    """Innovation in standard deviations; 0 where none is expected."""
    is_known = std > 0.0
    return where(is_known, innovation / where(is_known, std, 1.0), 0.0)


def mean(before: Scalar, value: Scalar, samples: Scalar) -> Scalar:
    """Mean of a value over about so many samples."""
    return before + (value - before) / where(samples > 1.0, samples, 1.0)
