"""The reduced model of [RTS] from the paper in plain numpy, for complex numbers too, and its Jacobians by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

TABLE_I = {
    "T_s": 20e-6, "R": 48.0, "m": 1.6e-9, "k_sp": 6.18e-5, "z_sp": 18.8, "c_f": 8e-7, "R_c0": 1.75, "lam_sat": 0.0238,
    "z_min": 0.4e-3, "l_z": 1e-3, "N": 1200.0, "Rg0": 0.0, "Rgp": 4.7e10, "k_f": 300.0, "c": 9.73e-3, "memory": 1.0,
}  # fmt: skip


def gap(z: Any, p: dict[str, Any]) -> tuple[Any, Any, Any]:
    """R_g*, its first and its second derivative by z*; from `table`, gaps and reluctances, if there is one."""
    g = p["z_min"] + p["l_z"] * z
    if "table" in p:
        return tuple(R * p["l_z"] ** k / p["N"] ** 2 for k, R in enumerate(spline(g, *p["table"])))
    L = np.log(p["c"] / g)
    D, a = 1.0 + p["k_f"] * g * L, p["Rgp"] / p["N"] ** 2
    slope = a * (1.0 + p["k_f"] * g) / D**2
    bend = a * (p["k_f"] * D - 2.0 * (1.0 + p["k_f"] * g) * p["k_f"] * (L - 1.0)) / D**3
    return p["Rg0"] / p["N"] ** 2 + a * g / D, slope * p["l_z"], bend * p["l_z"] ** 2


def spline(g: Any, gaps: Any, reluctances: Any) -> tuple[Any, Any, Any]:
    """Value, first and second derivative of the cubic spline, which beyond its ends goes on as a parabola."""
    made = CubicSpline(gaps, reluctances)
    if not gaps[0] <= np.real(g) <= gaps[-1]:
        end = gaps[0] if np.real(g) < gaps[0] else gaps[-1]
        (y, slope, bend), t = (float(made(end, k)) for k in range(3)), g - end
        return y + slope * t + 0.5 * bend * t**2, slope + bend * t, bend
    k = min(max(int(np.searchsorted(gaps, np.real(g))) - 1, 0), len(gaps) - 2)
    (d, c, b, a), t = made.c[:, k], g - gaps[k]
    return a + b * t + c * t**2 + d * t**3, b + 2.0 * c * t + 3.0 * d * t**2, 2.0 * c + 6.0 * d * t


def core(lam: Any, p: dict[str, float]) -> tuple[Any, Any]:
    """R_c* and its derivative, for lambda of either sign."""
    sign = np.sign(np.real(lam))
    x = sign * lam / p["lam_sat"]
    if np.real(x) < 0.95:
        return p["R_c0"] / (1.0 - x), sign * p["R_c0"] / p["lam_sat"] / (1.0 - x) ** 2
    slope = p["R_c0"] / 0.05**2
    return p["R_c0"] / 0.05 + slope * (x - 0.95), sign * slope / p["lam_sat"]


def h(x: Any, p: dict[str, float]) -> Any:
    return (gap(x[0], p)[0] + core(x[2], p)[0]) * x[2] + x[3]


def f(x: Any, v: float, q: int, p: dict[str, float]) -> Any:
    z, z_prev, lam, e_i, e_F = x
    at, speed = (z, (z - z_prev) / p["T_s"]) if q == 2 else (0.0 if q == 1 else 1.0, 0.0)
    force = p["k_sp"] * (p["z_sp"] - at) - p["c_f"] * speed - 0.5 * gap(at, p)[1] * lam**2 + e_F
    start = 2.0 * z - z_prev if q == 2 else at
    memory = 1.0 if q == 2 else p["memory"]
    lam_next = lam + p["T_s"] * (v - p["R"] * h(x, p))
    return np.array([start + p["T_s"] ** 2 * force / p["m"], z, lam_next, memory * e_i, e_F])


def H(x: Any, p: dict[str, float]) -> Any:
    R_c, slope = core(x[2], p)
    R_g, R_g1, _ = gap(x[0], p)
    return np.array([R_g1 * x[2], 0.0, R_g + R_c + slope * x[2], 1.0, 0.0])


def F(x: Any, q: int, p: dict[str, float]) -> Any:
    z, lam, k = x[0], x[2], p["T_s"] ** 2 / p["m"]
    first = np.zeros(5)
    at = z if q == 2 else (0.0 if q == 1 else 1.0)
    if q == 2:
        first[0] = 2.0 - k * (p["k_sp"] + p["c_f"] / p["T_s"] + 0.5 * gap(z, p)[2] * lam**2)
        first[1] = k * p["c_f"] / p["T_s"] - 1.0
    first[2], first[4] = -k * gap(at, p)[1] * lam, k
    third = np.array([0.0, 0.0, 1.0, 0.0, 0.0]) - p["T_s"] * p["R"] * H(x, p)
    memory = 1.0 if q == 2 else p["memory"]
    return np.array([first, [1, 0, 0, 0, 0], third, [0, 0, 0, memory, 0], [0, 0, 0, 0, 1]], float)
