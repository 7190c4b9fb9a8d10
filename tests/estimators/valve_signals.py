"""Signals of the solenoid valve model, whose gap and core laws are those of the reduced model."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from kernel_cases import components, kernel
from table_i import defaults

from gapsense.actuators.magnetics import MU_0
from gapsense.estimators import ekf

T_S = 20e-6
AREA, WINDOW = 1.75e-5, 10e-3


class Signals(NamedTuple):
    """Samples at multiples of `T_S`, the first one at rest on the upper stop."""

    time: np.ndarray
    voltage: np.ndarray
    current: np.ndarray  # without noise
    mode: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    flux_linkage: np.ndarray


@cache
def valve(cycles: int = 1, low: float = 1e-4) -> Signals:
    """30 V for 10 ms and 0 V for 10 ms, held from sample to sample; the lower stop is at `low`."""
    plant = kernel("gapsense.actuators.solenoid_valve")
    component, _ = components()["gapsense.actuators.solenoid_valve"]
    values: dict[str, Any] = {p.field: 0.0 if p.choices else p.start for p in component.of("parameter")}
    tables = {"gap_file_gap": [0.0, 1e-3], "gap_file_reluctance": [0.0, 1.0], "gap_file_slope": [1.0, 1.0]}
    values |= tables | {"gap_law": 1.0, "stop_lower": low}
    par = plant.module.Parameters(*(values[name] for name in plant.module.Parameters._fields))
    state, outputs = plant.initial(_inputs(plant, 0.0, 0.0, 0.0), par)
    rows = [(0.0, 0.0, outputs)]
    for k in range(1, cycles * 1000 + 50):
        state, outputs = plant.step(state, _inputs(plant, k * T_S, T_S, rows[-1][1]), par)
        is_on = k >= 50 and (k - 50) % 1000 < 500
        rows.append((k * T_S, 30.0 if is_on else 0.0, outputs))
    fields = ("current", "mode", "position", "velocity", "flux_linkage")
    columns = {name: np.array([float(getattr(o, name)) for _, _, o in rows]) for name in fields}
    return Signals(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), **columns)


def _inputs(plant: Any, time: float, dt: float, voltage: float) -> Any:
    given = {"time": time, "dt": dt, "voltage": voltage}
    return plant.module.Inputs(*(given[name] for name in plant.module.Inputs._fields))


def exact(low: float = 1e-4, **changes: Any) -> Any:
    """Parameters of the filter that are those of the valve."""
    values = {
        "coil_resistance": 76.0, "mover_mass": 1.6e-3, "spring_stiffness": 37.0, "spring_rest": 22.5e-3, "damping": 0.4,
        "stop_lower": low, "stop_upper": 0.9e-3, "core_reluctance": 3.25e6, "core_saturation": 24e-3,
        "gap_slope": 1.0 / (MU_0 * AREA), "gap_fringing": AREA**-0.5, "gap_window": 2.0 * WINDOW,
    }  # fmt: skip
    return defaults(ekf, **(values | changes))
