"""Voltages that nothing is learnt for: ordinary switching, and the nominal profile of a soft landing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from gapsense.control.mover import Mover, make_mover
from gapsense.control.profile import Operation, flux, is_planned, path
from gapsense.control.records import CLOSING, OPENING, Parameters
from gapsense.control.tracking import plan_operation
from gapsense.estimators.mhe.model import gap

from ..estimators.parameters import VALVE

Floats = npt.NDArray[np.float64]
SPEED, TAIL = 0.4, 2.2e-3  # of the nominal approach [m/s]; its time: then comes the ordinary voltage [s]


def ordinary(counts: tuple[int, int], par: Parameters) -> Floats:
    """Voltage of each sample of a cycle; `counts` are its samples, and those of them that are closed."""
    return np.where(np.arange(counts[0]) < counts[1], par.voltage_hold, 0.0)


def nominal(counts: tuple[int, int], par: Parameters) -> Floats:
    """The profile that is softest for the nominal actuator, by nominal resistance and core."""
    m, volts = make_mover(par), ordinary(counts, par)
    halves = ((CLOSING, 0, par.closing_travel, 0.0), (OPENING, counts[1], par.opening_travel, held(m, par)))
    for half, first, travel, start in halves:
        plan = plan_operation(half, SPEED, travel, start, par)._replace(tail=TAIL)
        soft = profile(plan, m, par)[: counts[0] - first]
        volts[first : first + soft.size] = soft
    return np.clip(volts, par.voltage_least, par.voltage_most)


def profile(plan: Operation, m: Mover, par: Parameters) -> Floats:
    """Voltages of an operation, from its command to the end of its approach."""
    dt, R, volts = par.sample_time, par.coil_resistance, list[float]()
    while is_planned((time := len(volts) * dt) + dt, plan):
        now, then = flux(time, plan, m), flux(time + dt, plan, m)
        z = path(time + 0.5 * dt - plan.lead, plan, m).position
        volts.append((then - now) / dt + R * current(0.5 * (now + then), z, m))
    return np.array(volts)


def held(m: Mover, par: Parameters) -> float:
    """Flux linkage of the ordinary voltage, with the mover on its lower stop [Wb]."""
    wanted, most = par.voltage_hold / par.coil_resistance, (1.0 - 1e-6) * VALVE.saturation
    return float(brentq(lambda x: current(x, m.gap.smallest, m) - wanted, 0.0, most))


def current(flux_linkage: float, z: float, m: Mover) -> float:
    """Current of the nominal core, without its losses [A]."""
    core = VALVE.core / VALVE.turns**2 / (1.0 - abs(flux_linkage) / VALVE.saturation)
    return float((gap(z, m.gap, m.factor, m.bend)[0] + core) * flux_linkage)
