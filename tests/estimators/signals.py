"""A coil like the valve of [SEMERA], with a prescribed inductance: true in the sense of (2), backward difference."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.estimators import semera

DT, REST = 50e-6, 20


class Signal(NamedTuple):
    u: np.ndarray  # measured voltage [V]
    iota: np.ndarray  # measured current [A]
    l: np.ndarray  # true inductance [H]
    flux_linkage: np.ndarray  # true [Wb]


def valve_like(
    cycles: int = 4, r: float = 76.0, seed: int = 1, noise: float = 1.0, moving: bool = True, rest: int = REST
) -> Signal:
    """30 V for 10 ms, 0 V for 10 ms; the inductance rises from 52 to 120 mH between 4 and 5 ms, falls after 12 ms."""
    count = rest + cycles * 400
    phase = ((np.arange(count) - rest) % 400) * DT
    resting = np.arange(count) < rest
    v = np.where(resting | (phase >= 10e-3), 0.0, 30.0)
    rise, fall = np.clip((phase - 4e-3) / 1e-3, 0.0, 1.0), np.clip((phase - 12e-3) / 1e-3, 0.0, 1.0)
    smooth = [s * s * (3.0 - 2.0 * s) for s in (rise, fall)]
    l = 0.052 + 0.068 * np.where(resting, 0.0, smooth[0] - smooth[1]) * moving
    currents, volts, inductances = [0.0], v.tolist(), l.tolist()
    for k in range(1, count):  # v = r i + (l_k i_k - l_(k-1) i_(k-1)) / dt
        currents.append((volts[k] * DT + inductances[k - 1] * currents[-1]) / (r * DT + inductances[k]))
    i = np.array(currents)
    rng = np.random.default_rng(seed)
    u = v + noise * 15e-3 * rng.standard_normal(count)
    return Signal(u, i + noise * 1e-3 * rng.standard_normal(count), l, l * i)


TABLE_II = semera.Parameters(
    sample_time=DT, prior_resistance=77.5, prior_resistance_std=1.0, prior_inductance=50e-3,
    prior_inductance_std=5e-3, process_resistance_rate=1.0, process_inductance_acceleration=1e8, noise_voltage=15e-3,
    noise_current=1e-3, gate_sigmas=3.29, gate_update=1.0, gate_decay=0.0,
    range_voltage=1e3, range_current=5.0, coil_turns=0.0,
)  # fmt: skip
