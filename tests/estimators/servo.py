"""A servo that holds or moves the mover of the valve between its stops."""

from __future__ import annotations

from functools import cache

import numpy as np
from c_code import fresh
from lossy_valve import HALF, START, T_S
from mhe_plant import CYCLE, Plant
from soft_landings import balance

from gapsense.actuators import reluctance_actuator
from gapsense.studies.devices import RTS_VALVE

STROKE = RTS_VALVE.stop_upper - RTS_VALVE.stop_lower
LEVELS = (0.5, 0.3, 0.7, 0.4, 0.6, 0.5)  # of the stroke: steps of a servo


@cache
def served(kind: str) -> tuple[Plant, int, int]:
    """Six cycles, 0.15 s of a servo that has the position, and six cycles more; where the servo begins and ends."""
    par, frequency, sink = RTS_VALVE, 2.0 * np.pi * 300.0, 60e-6
    valve, names = fresh(reluctance_actuator), reluctance_actuator.Outputs._fields
    entries, low = (
        {name: np.float64(value) for name, value in par._asdict().items() if np.ndim(value) == 0},
        par.stop_lower,
    )
    valve.call("initial", (0.0, 0.0, 0.0), par)
    found, voltages, n = [valve.outputs.tolist()], [0.0], 0
    first, last = START + 6 * CYCLE, START + 6 * CYCLE + 7500
    for n in range(1, last + START + 6 * CYCLE):
        now = dict(zip(names, found[-1]))
        k = n - START if n < first else n - last - START
        u = 30.0 if k >= 0 and k % CYCLE < HALF else 0.0
        if first <= n < last:
            t = (n - first) * T_S
            shares = {"hold": 0.5, "sine": 0.5 + 0.3 * np.sin(2.0 * np.pi * 12.0 * t), "steps": LEVELS[int(t / 25e-3)]}
            wanted = low + shares[kind] * STROKE
            wanted = par.stop_upper + (wanted - par.stop_upper) * min(1.0, t / 5e-3)
            force, square = balance(np.float64(now["position"]), entries)
            a = np.clip(frequency**2 * (wanted - now["position"]) - 1.8 * frequency * now["velocity"], -400.0, 400.0)
            flux = np.sqrt(max(square * (1.0 - (par.mover_mass * a + par.damping * now["velocity"]) / force), 1e-9))
            u = float(np.clip(par.coil_resistance * now["current"] + (flux - now["flux_linkage"]) / sink, -48.0, 48.0))
        valve.call("step", (n * T_S, T_S, u), par)
        found.append(valve.outputs.tolist())
        voltages.append(u)
    signals = np.array(found, float)[:, [names.index(name) for name in Plant._fields[1:]]]
    return Plant(np.array(voltages), *signals.T), first, last
