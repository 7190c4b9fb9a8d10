"""The phases of a cycle with soft landing: rest under a constant voltage, and motion."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from gapsense.actuators import motion, reluctance_actuator
from gapsense.actuators.magnetics import flux_force, smooth_gap_law
from gapsense.actuators.motion import CLOSED, MOVING, OPEN
from gapsense.actuators.reluctance_actuator import Inputs, Parameters, State
from gapsense.actuators.reluctance_steps import Actuator
from gapsense.kernel import Kernel
from gapsense.studies.soft_landing.inverse import SoftLandingError, follow, needed_flux
from gapsense.studies.soft_landing.trajectory import Motion

Vector = npt.NDArray[np.float64]
BALANCE = 1e-6  # net force that counts as none, in forces of the spring
LOCK = 1e9  # rest position of the spring that holds the mover on its stop, by 1 N/m


class Cycle(NamedTuple):
    """One period, arrays (n,); at the ends of the phases, where the voltage may jump, a time comes twice."""

    time: Vector
    voltage: Vector
    position: Vector
    velocity: Vector
    acceleration: Vector
    flux: Vector
    effective_field: Vector
    core_field: Vector
    current: Vector
    mode: Vector
    flux_linkage: Vector


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
        return float(kernel().step(state, Inputs(m.start, lead, voltage), par)[0].flux - target)

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
    rows = [kernel().step(state, Inputs(begin, 0.0, voltage), par)]
    for before, t in zip(times[:-1].tolist(), times[1:].tolist()):
        rows.append(kernel().step(rows[-1][0], Inputs(t, t - before, voltage), par))
    flux = np.array([s.flux for s, _ in rows])
    _, slope, _ = smooth_gap_law(state.position, run.act.gap)
    spring = motion.spring_force(state.position, run.act.mover)
    leaving = motion.inward(state.mode, flux_force(flux, slope) + spring) > BALANCE * abs(spring)
    if leaving.any():
        raise SoftLandingError(
            f"t = {times[leaving.argmax()]:.6g} s: the mover leaves its stop under {voltage:.4g} V, before its time. "
            "Correct `hold_voltage`, or `lead`."
        )
    held = np.ones(times.size)
    cycle = Cycle(
        time=times,
        voltage=voltage * held,
        position=state.position * held,
        velocity=0.0 * held,
        acceleration=0.0 * held,
        flux=flux,
        effective_field=np.array([s.effective_field for s, _ in rows]),
        core_field=np.array([o.core_field for _, o in rows]),
        current=np.array([o.current for _, o in rows]),
        mode=state.mode * held,
        flux_linkage=run.par.coil_turns * flux,
    )
    return cycle, rows[-1][0]


def move(run: Setup, state: State, m: Motion) -> tuple[Cycle, State]:
    """Samples of the motion, and the state of the mover landed."""
    times = _grid(m.start, m.start + m.duration, run.par.micro_step)
    rows = follow(m, state.effective_field, run.act, times)
    beyond = next((r for r in rows if not abs(r.voltage) <= run.highest), None)
    if beyond:
        raise SoftLandingError(
            f"t = {beyond.time:.6g} s: this motion needs {beyond.voltage:.4g} V, more than `highest_voltage` of "
            f"{run.highest} V. Make its duration longer than {m.duration} s, or `highest_voltage` higher."
        )
    last, mode = rows[-1], CLOSED if m.last < m.first else OPEN
    cycle = Cycle(*np.array([(*r, MOVING, run.par.coil_turns * r.flux) for r in rows]).T)
    return cycle, State(last.flux, last.effective_field, m.last, 0.0, mode, 0.0, 0.0, 0.0, 0.0)


def _grid(begin: float, end: float, step: float) -> Vector:
    return np.linspace(begin, end, math.ceil((end - begin) / step - 1e-6) + 1)


def _locked(par: Parameters, mode: float) -> Parameters:
    """The actuator with its mover held on its stop by a spring that never gives way."""
    return par._replace(spring_stiffness=1.0, spring_rest=LOCK if mode == OPEN else -LOCK)


@cache
def kernel() -> Kernel:
    """The actuator on floats."""
    return Kernel(reluctance_actuator)
