"""Algorithm 1 of [SEMERA], as printed, with numpy matrices; nothing of the project is used."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class Result(NamedTuple):
    """Published estimates of every sample, sample 0 included; the last prior and its covariance."""

    r: np.ndarray
    l: np.ndarray
    flux_linkage: np.ndarray
    is_high: np.ndarray
    x: np.ndarray
    P: np.ndarray


def semera(
    u: np.ndarray,
    iota: np.ndarray,
    dt: float,
    r0: float,
    r0_std: float,
    l0: float,
    l0_std: float,
    rate_std: float,
    acceleration_std: float,
    sigma_v: float,
    sigma_i: float,
    n_sigma: float,
    joseph: bool,
    dtype: Any = np.float64,
) -> Result:
    F = np.array([[1, 0, 0], [0, 2, -1], [0, 1, 0]], dtype)  # (21)
    G = np.array([[dt, 0], [0, dt**2], [0, 0]], dtype)  # (23)
    Q = np.diag([rate_std**2, acceleration_std**2]).astype(dtype)  # (24)
    x = np.array([[r0], [l0], [l0]], dtype)  # line 1, (25)
    v = l0_std**2
    P = np.array([[r0_std**2, 0, 0], [0, v, v], [0, v, v]], dtype)  # line 2, (26)
    r, l, high = [dtype(r0)], [dtype(l0)], [False]
    eye = np.eye(3, dtype=dtype)
    sv2 = dtype(sigma_v**2)
    for k in range(1, len(u)):
        z = dtype(u[k])  # line 6
        H = np.array([[iota[k], iota[k] / dt, -iota[k - 1] / dt]], dtype)  # line 7
        K = P @ H.T / (H @ P @ H.T + sv2)  # line 8
        x = x + K * (z - H @ x)  # line 9
        A = eye - K @ H
        P = A @ P @ A.T + sv2 * (K @ K.T) if joseph else A @ P  # line 10
        is_high = abs(iota[k]) > n_sigma * sigma_i and abs(iota[k - 1]) > n_sigma * sigma_i  # line 13
        r.append(x[0, 0] if is_high else r[-1])  # lines 14, 15
        l.append(x[1, 0] if is_high else dtype(l0))
        high.append(bool(is_high))
        x = F @ x  # line 11
        P = F @ P @ F.T + G @ Q @ G.T  # line 12
    return Result(np.array(r), np.array(l), np.array(l) * iota, np.array(high), x[:, 0], P)  # line 16
