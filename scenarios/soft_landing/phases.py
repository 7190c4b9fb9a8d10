"""The phases of a cycle with soft landing: rest under a constant voltage, and motion."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from gapsense.actuators import motion, reluctance_actuator
from gapsense.actuators.magnetics import flux_force, smooth_gap_law
from gapsense.actuators.motion import CLOSED, OPEN
from gapsense.actuators.reluctance_actuator import Inputs, Parameters, State
from gapsense.actuators.reluctance_steps import Actuator
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import blank

from .inverse import Cycle, SoftLandingError, Vector, follow, needed_flux
from .trajectory import Motion

KERNEL = Kernel(reluctance_actuator)
BALANCE = 1e-6  # net force that counts as none, in forces of the spring
LOCK = 1e9  # rest position of the spring that holds the mover on its stop, by 1 N/m


class Setup(NamedTuple):
    """What does not change during a run."""

    par: Parameters
    act: Actuator
    highest: float  # voltage of the drive [V]


def balancing_voltage(run: Setup, state: State, m: Motion, lead: float) -> float:
    """Constant voltage during `lead` after which the magnet balances the spring, as the motion starts with it [V]."""
    target = needed_flux(m.start, m, run.act).flux
    par = _locked(run.par, state.mode)

    def lacking(voltage: float) -> float:
        return float(KERNEL.step(state, Inputs(m.start, lead, voltage), par)[0].flux - target)

    low, high = lacking(-run.highest), lacking(run.highest)
    if not low < 0.0 < high:
        raise SoftLandingError(
            f"t = {m.start:.6g} s: the motion needs a flux of {target:.4g} Wb at its start; between "
            f"-{run.highest} V and {run.highest} V, {lead} s reach {target + low:.4g} to {target + high:.4g} Wb. "
            "Make `lead` longer, or `highest_voltage` higher."
        )
    return float(brentq(lacking, -run.highest, run.highest, xtol=1e-13, rtol=1e-15))


def rest(run: Setup, state: State, begin: float, end: float, voltage: float) -> tuple[Cycle, State]:
    """Samples of the mover at rest under a constant voltage, and the state at the end."""
    par, times = _locked(run.par, state.mode), _grid(begin, end, run.par.micro_step)
    rows = [KERNEL.step(state, Inputs(begin, 0.0, voltage), par)]
    for before, t in zip(times[:-1].tolist(), times[1:].tolist()):
        rows.append(KERNEL.step(rows[-1][0], Inputs(t, t - before, voltage), par))
    flux, H_e, H_c, i = np.array([(s.flux, s.effective_field, o.core_field, o.current) for s, o in rows]).T
    _, slope, _ = smooth_gap_law(state.position, run.act.gap)
    spring = motion.spring_force(state.position, run.act.mover)
    leaving = motion.inward(state.mode, flux_force(flux, slope) + spring) > BALANCE * abs(spring)
    if leaving.any():
        raise SoftLandingError(
            f"t = {times[leaving.argmax()]:.6g} s: the mover leaves its stop under {voltage:.4g} V, before its time. "
            "Correct `hold_voltage`, or `lead`."
        )
    u, z, none, mode = (np.full(times.size, value) for value in (voltage, state.position, 0.0, state.mode))
    return Cycle(
        time=times,
        voltage=u,
        position=z,
        velocity=none,
        acceleration=none,
        flux=flux,
        effective_field=H_e,
        core_field=H_c,
        current=i,
        mode=mode,
        flux_linkage=run.par.coil_turns * flux,
    ), rows[-1][0]


def move(run: Setup, state: State, m: Motion) -> tuple[Cycle, State]:
    """Samples of the motion, and the state of the mover landed."""
    times = _grid(m.start, m.start + m.duration, run.par.micro_step)
    cycle = follow(m, state.effective_field, run.act, times)
    beyond = ~(np.abs(cycle.voltage) <= run.highest)
    if beyond.any():
        k = beyond.argmax()
        raise SoftLandingError(
            f"t = {times[k]:.6g} s: this motion needs {cycle.voltage[k]:.4g} V, more than `highest_voltage` of "
            f"{run.highest} V. Make its duration longer than {m.duration} s, or `highest_voltage` higher."
        )
    flux, H_e, mode = float(cycle.flux[-1]), float(cycle.effective_field[-1]), CLOSED if m.last < m.first else OPEN
    return cycle, blank(State, flux=flux, effective_field=H_e, position=m.last, mode=mode)


def parts(cycle: Cycle) -> list[Any]:
    """Rows of each phase of a cycle."""
    return np.split(np.arange(cycle.time.size), np.flatnonzero(np.diff(cycle.time) == 0.0) + 1)


def _grid(begin: float, end: float, step: float) -> Vector:
    return np.linspace(begin, end, math.ceil((end - begin) / step - 1e-6) + 1)


def _locked(par: Parameters, mode: float) -> Parameters:
    """The actuator with its mover held on its stop by a spring that never gives way."""
    return par._replace(spring_stiffness=1.0, spring_rest=LOCK if mode == OPEN else -LOCK)
