"""The discretised valve model of [UKF] in numpy, vectorised, written apart from the code: with dictionaries, in phi."""

from __future__ import annotations

from typing import Any

import numpy as np

VALVE = {
    "T": 20e-6, "R": 77.5, "N": 1200.0, "k_1": 3.25e6, "lambda_sat": 0.024, "m": 1.6e-3, "k_sp": 37.0, "z_sp": 22.5e-3,
    "c_f": 0.4, "z_max": 0.9e-3,
}  # fmt: skip


def gap(z: Any, table: Any) -> tuple[Any, Any]:
    """Reluctance and derivative, by linear interpolation."""
    return np.interp(z, table[0], table[1]), np.interp(z, table[0], table[2])


def current(lam: Any, z: Any, eps: Any, p: dict[str, float], table: Any) -> Any:
    """(27)"""
    phi = lam / p["N"]
    R_c = p["k_1"] / (1.0 - np.abs(phi) * p["N"] / p["lambda_sat"])
    return (gap(z, table)[0] + R_c) * phi / p["N"] - eps


def f(x: Any, v: float, p: dict[str, float], table: Any) -> Any:
    """(26), (28)-(31); the current of the interval by a Newton step towards the trapezoidal rule."""
    lam, z, z_prev, eps = x
    phi, T = lam / p["N"], p["T"]
    slope = gap(z, table)[1]
    force = -0.5 * slope * phi**2 + p["k_sp"] * (p["z_sp"] - z) - p["c_f"] * (z - z_prev) / T
    z_next = 2.0 * z - z_prev + T**2 * force / p["m"]
    i = current(lam, z, eps, p, table)
    x_sat = np.abs(lam) / p["lambda_sat"]
    by_lam = (gap(z, table)[0] + p["k_1"] / (1.0 - x_sat) ** 2) / p["N"] ** 2
    i_moved = i + 0.5 * slope * lam / p["N"] ** 2 * (z - z_prev)
    lam_next = lam + T * (v - p["R"] * i_moved) / (1.0 + 0.5 * T * p["R"] * by_lam)
    return np.array([lam_next, np.clip(z_next, 0.0, p["z_max"]), z, p["phi"] * eps])
