"""Perturbed models as the parameters of `ekf`, and as those of the textbook oracle, the gap law after (56)-(57)."""

from __future__ import annotations

from typing import Any

import numpy as np
import reduced_model_textbook as textbook
from table_i import defaults

from gapsense.estimators import ekf
from gapsense.estimators.reduced_model import Model
from gapsense.scenarios.soft_landing.batch import Tuning, Variant, Varied


def filter_parameters(m: Model, varied: Varied, run: int, tuning: Tuning, variant: Variant) -> Any:
    """`ekf.Parameters` of one run, in physical units (17)."""
    N, l_z = 1200.0, m.l_z
    one = Varied(*(float(value[run]) for value in varied))
    physical = {
        "sample_time": m.T_s, "mover_mass": one.m / l_z**2, "spring_stiffness": one.k_sp / l_z**2,
        "spring_rest": m.z_min + l_z * one.z_sp, "damping": one.c_f / l_z**2, "core_reluctance": one.R_c0 * N**2,
        "process_current_error_memory": 0.0 if m.memory == 1.0 else -m.T_s / np.log(m.memory),
        "core_saturation": one.lam_sat, "gap_reluctance": one.gap_offset * N**2, "gap_tilt": one.gap_tilt * N**2 / l_z,
    }  # fmt: skip
    return defaults(ekf, **physical, **tuning._asdict(), **variant._asdict())


class Textbook:
    """The textbook model of a run with relative errors of the eight parameters (52)."""

    def __init__(self, m: Model, errors: Any, mean: float, mean_slope: float) -> None:
        e = [float(value) for value in errors]
        self.p = {
            **textbook.TABLE_I, "T_s": m.T_s, "m": 1.6e-9 * (1 + e[0]), "k_sp": 6.18e-5 * (1 + e[1]),
            "z_sp": 18.8 * (1 + e[2]), "c_f": 8e-7 * (1 + e[3]), "R_c0": m.R_c0 * (1 + e[4]),
            "lam_sat": m.lam_sat * (1 + e[5]),
        }  # fmt: skip
        self.offset, self.tilt = mean * e[6], mean_slope * e[7]

    def gap(self, z: float) -> tuple[float, float]:
        """R_g* (56) and its derivative (57)."""
        R, slope, _ = textbook.gap(z, self.p)
        return R + self.offset + (z - 0.5) * self.tilt, slope + self.tilt

    def current(self, z: float, lam: float) -> float:
        """f_i* (14) without e_i."""
        return (self.gap(z)[0] + textbook.core(lam, self.p)[0]) * lam

    def next_position(self, z: float, z_prev: float, lam: float, e_F: float, q: float, contact_force: bool) -> float:
        """f_z* (22), or (66) without the contact force."""
        p, at = self.p, z if q == 2.0 else 0.0 if q == 1.0 else 1.0
        if q != 2.0 and not contact_force:
            return at
        speed = (z - z_prev) / p["T_s"] if q == 2.0 else 0.0
        force = p["k_sp"] * (p["z_sp"] - at) - p["c_f"] * speed - 0.5 * self.gap(at)[1] * lam**2 + e_F
        return (2.0 * z - z_prev if q == 2.0 else at) + p["T_s"] ** 2 * force / p["m"]
