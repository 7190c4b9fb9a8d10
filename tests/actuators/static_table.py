"""The table that `fmus/table_actuator/map.csv` holds: the reluctance actuator of [RTS] without losses.

python tests/actuators/static_table.py     writes it again
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from gapsense.actuators import magnetics
from gapsense.actuators.reluctance_actuator import Parameters

FILE = Path(__file__).parents[2] / "fmus" / "table_actuator" / "map.csv"
MU_0 = 4e-7 * np.pi
FLUX_LINKAGES = np.r_[0:14:2, 14:20:1, 20:23:0.5, 23:25:0.4, 25:26.3:0.3]  # mWb
GAPS = np.array([0.3, 0.4, 0.5, 0.6, 0.75, 0.9, 1.05, 1.2, 1.3, 1.4, 1.5])  # mm
HEAD = "gap [m],flux_linkage [Wb],current [A]"


def core_field(flux: float, par: Parameters) -> float:
    """Field of the core without hysteresis [A/m]: B/mu0 - H_e = (1 - alpha) M_an(H_e)."""
    induction = flux / (par.core_area * MU_0)

    def excess(H_e: float) -> float:
        x = H_e / par.core_shape
        langevin = 1.0 / np.tanh(x) - 1.0 / x if abs(x) > 1e-3 else x / 3.0 - x**3 / 45.0
        return float(induction - H_e - (1.0 - par.core_coupling) * par.core_magnetization * langevin)

    H_e = brentq(excess, 0.0, induction + 1.0, xtol=1e-12, rtol=1e-15) if flux else 0.0
    return H_e - par.core_coupling * (induction - H_e) / (1.0 - par.core_coupling)


def current(gap: float, flux_linkage: float, par: Parameters) -> float:
    """Static current of the actuator [A]."""
    flux = flux_linkage / par.coil_turns
    R, _, _ = magnetics.fringing(gap, par.gap_slope, par.gap_fringing, par.gap_window)
    return float(((par.gap_reluctance + R) * flux + core_field(flux, par) * par.core_length) / par.coil_turns)


def write(file: Path, gaps: np.ndarray, flux_linkages: np.ndarray, law: Callable[[float, float], float]) -> Path:
    """A table of this law."""
    rows = [f"{h:.9g},{lam:.9g},{law(h, lam):.9g}" for h in gaps for lam in flux_linkages]
    file.write_text("\n".join([HEAD, *rows, ""]), encoding="utf-8")
    return file


if __name__ == "__main__":
    write(FILE, 1e-3 * GAPS, 1e-3 * FLUX_LINKAGES, lambda h, lam: current(h, lam, Parameters()))
