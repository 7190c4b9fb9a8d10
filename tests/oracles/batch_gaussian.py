"""All states of a linear system given all measurements, as one Gaussian."""

from __future__ import annotations

from typing import Any

import numpy as np


def batch(
    x0: Any, P0: Any, Fs: Any, Q: Any, Hs: Any, R: Any, ys: Any, offsets: Any = None
) -> tuple[np.ndarray, np.ndarray]:
    """Means (N, n) and covariances (N, n, n) of all states given all measurements, as one Gaussian."""
    n, N = len(x0), len(Fs) + 1
    A = np.zeros((N * n, N * n))  # all states from the first one and the process noises
    A[:n, :n] = np.eye(n)
    for k, F in enumerate(Fs):
        rows = slice((k + 1) * n, (k + 2) * n)
        A[rows] = F @ A[k * n : (k + 1) * n]
        A[rows, rows] = np.eye(n)
    W = np.zeros((N * n, N * n))
    for k in range(N):
        W[k * n : (k + 1) * n, k * n : (k + 1) * n] = P0 if k == 0 else Q
    mean, P = A[:, :n] @ x0, A @ W @ A.T
    for k, offset in enumerate(() if offsets is None else offsets):
        mean = mean + A[:, (k + 1) * n : (k + 2) * n] @ offset
    H = np.zeros((sum(map(len, Hs)), N * n))
    row = 0
    for k, h in enumerate(Hs):
        H[row : row + len(h), k * n : (k + 1) * n] = h
        row += len(h)
    S = H @ P @ H.T + np.diag(np.concatenate(R))
    scale = 1.0 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    inverse = np.linalg.pinv(S * np.outer(scale, scale), rcond=1e-12) * np.outer(scale, scale)
    K = P @ H.T @ inverse
    mean = mean + K @ (np.concatenate(ys) - H @ mean)
    P = P - K @ H @ P
    blocks = [P[k * n : (k + 1) * n, k * n : (k + 1) * n] for k in range(N)]
    return mean.reshape(N, n), np.array(blocks)
