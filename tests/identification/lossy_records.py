"""Records of a valve whose core has losses, by a simulation of its own: Runge-Kutta at 2.5 us, nothing of the kernels.

Eddy currents and Dahl's hysteresis are states or terms of one set of differential equations here; the gap is linear or
has fringes.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from valve_records import DT, ON, PERIOD, REST

from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.studies.devices import VALVE

FINE = 2.5e-6  # s
MU_0 = 4e-7 * math.pi


def slopes(state, u, par, eddy, amplitude, length):
    """Rates of flux linkage, gap, velocity and h; the current."""
    lam, gap, speed, h = state
    m = lam / par.core_saturation
    reluctance, rate = gap_law(max(gap, 0.0), par)
    force = lam / par.coil_turns**2 * (reluctance + par.core_reluctance / (1.0 - abs(m))) + h * (1.0 + m * m)
    R = par.coil_resistance
    current = (eddy * u + force) / (1.0 + R * eddy)
    dlam = u - R * current
    turned = math.copysign(amplitude, dlam) - h if dlam else 0.0
    dh = abs(dlam) * turned / (length * max(0.1, 1.0 - 0.9 * m * m))
    pull = par.spring_stiffness * (par.spring_rest - gap) - par.damping * speed
    push = (pull - 0.5 * (lam / par.coil_turns) ** 2 * rate) / par.mover_mass
    is_held = (gap <= par.stop_lower and push < 0.0) or (gap >= par.stop_upper and push > 0.0)
    return (dlam, speed, 0.0 if is_held and speed == 0.0 else push, dh), current


def gap_law(gap, par):
    """Reluctance and its derivative."""
    if par.gap_law == 0 or gap <= 0.0:
        return (par.gap_slope * gap, par.gap_slope) if par.gap_law == 0 else (0.0, 1.0 / (MU_0 * par.gap_area))
    r0, k = 1.0 / (MU_0 * par.gap_area), par.gap_area**-0.5
    wide = 1.0 + k * gap * math.log(2.0 * par.gap_window / gap)
    return r0 * gap / wide, r0 * (1.0 + k * gap) / wide**2


def stepped(state, u, par, losses):
    """One step; the mover stops dead at the stops."""

    def at(rates, part):
        return tuple(x + part * FINE * r for x, r in zip(state, rates))

    k1, _ = slopes(state, u, par, *losses)
    k2, _ = slopes(at(k1, 0.5), u, par, *losses)
    k3, _ = slopes(at(k2, 0.5), u, par, *losses)
    k4, _ = slopes(at(k3, 1.0), u, par, *losses)
    lam, gap, speed, h = at([(a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4)], 1.0)
    inside = min(max(gap, par.stop_lower), par.stop_upper)
    return (lam, inside, speed if inside == gap else 0.0, h)


def simulated(volts, par, losses, dt=DT):
    """Current and gap at samples, the voltage of each half interval being given; the same ones only once."""
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in par._asdict().items()}
    return _simulated(tuple(volts), type(par)(**given), losses, dt).copy()


@cache
def _simulated(volts, par, losses, dt):
    state = (0.0, par.stop_upper, 0.0, 0.0)
    rows, count = [], round(0.5 * dt / FINE)
    for k, u in enumerate(volts):
        for _ in range(count):
            state = stepped(state, u, par, losses)
        if k % 2 == 0:
            rows.append((slopes(state, u, par, *losses)[1], state[1]))
    return np.array(rows).T


def lossy(
    periods=2, volts=30.0, seed=None, noise=(15e-3, 1e-3), par=VALVE, dt=DT, eddy=0.0, amplitude=0.0, length=1.7e-3
) -> Record:
    """Square waves from rest on, with edges half-way between two samples."""
    count = 2 * (round(periods * PERIOD / dt) + REST)
    middle = (np.arange(count + 1) - 2 * REST - 1) * dt / 2.0 - dt / 4.0
    on = np.where((middle > 0.0) & (middle % PERIOD < ON), volts, 0.0)
    current, position = simulated(on.tolist(), par, (eddy, amplitude, length), dt)
    times = (np.arange(count + 1) - 2 * REST - 1)[::2] * dt / 2.0
    voltage = np.where((times > 0.0) & (times % PERIOD < ON), volts, 0.0)
    if seed is not None:
        rng = np.random.default_rng(seed)
        voltage = voltage + noise[0] * rng.standard_normal(times.size)
        current = current + noise[1] * rng.standard_normal(times.size)
    values = {"time": times, "voltage": voltage, "current": current, "position": position}
    return to_record(Columns("lossy.csv", np.arange(times.size) + 2, values))
