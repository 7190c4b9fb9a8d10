"""Actuators that differ from the believed one, in cycles of soft landings, and how well `Mhe` estimates them."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import soft_plant

from gapsense.estimators.mhe import mhe
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import step_runs
from gapsense.kernels.layout import flat
from gapsense.scenarios.estimators.parameters import VALVE, reduced
from gapsense.studies.devices import RTS_VALVE

CYCLE, CLOSED, CYCLES, RUNS = 20e-3, 9.8e-3, 8, 6  # [s], [s], cycles of each run, runs
LEAD, MOTION, TAIL, LAST = 1.2e-3, 3.4e-3, 2.2e-3, 0.12e-3  # of a motion [s], and its end at constant speed [m]
WRONG = ("mover_mass", "spring_stiffness", "damping", "gap_slope", "coil_resistance", "core_length",
         "core_magnetization", "core_eddy_conductance", "core_pinning")  # fmt: skip
SHOWN = ("position", "health", "smoothed_published", "smoothed_time", "smoothed_position", "windows", "landing_time",
         "impact_speed", "misfit")  # fmt: skip
BLIND = {"prior.eddy": 1.0, "prior.gap": 0.1, "prior.saturation": 0.1, "prior.mass": 0.1, "prior.rest": 0.1,
         "prior.core": 1.5, "prior.bend": 0.06}  # fmt: skip
TOLD = {"noise.current": 2e-3, "model.error": 1.8e-3, "edge": 3.0}


class Landings(NamedTuple):
    """Signals (samples, runs), and the stops of each run over those that are believed."""

    sample_time: float
    voltage: np.ndarray
    current: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    mode: np.ndarray
    scale: np.ndarray


def actuators(seed: int, restitution: float) -> dict[str, np.ndarray]:
    """All parameters up to 10 % off, both stops in proportion up to 5 %; each an array (runs,)."""
    rng = np.random.default_rng(seed)
    factors = {name: 1.0 + rng.uniform(-0.1, 0.1, RUNS) for name in (*WRONG, "rest")}
    par = {name: np.full(RUNS, float(value)) for name, value in RTS_VALVE._asdict().items() if np.ndim(value) == 0}
    par |= {name: par[name] * factors[name] for name in WRONG}
    lower, scale = par["stop_lower"], 1.0 + rng.uniform(-0.05, 0.05, RUNS)
    rest = lower + (par["spring_rest"] - lower) * factors["rest"]
    stops = {name: par[name] * scale for name in ("stop_lower", "stop_upper", "initial_position")}
    return {**par, **stops, "spring_rest": rest, "stop_restitution": np.full(RUNS, restitution)}


def balance(z: np.ndarray, par: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Force of the spring, and the square of the flux linkage that holds it."""
    k, ratio = par["gap_fringing"], np.log(par["gap_window"] / z)
    slope = par["gap_slope"] * (1.0 + k * z) / (1.0 + k * z * ratio) ** 2 / par["coil_turns"] ** 2
    force = par["spring_stiffness"] * (par["spring_rest"] - z)
    return force, 2.0 * force / slope


def flux(t: np.ndarray, way: float, speed: np.ndarray, start: float, par: dict[str, np.ndarray]) -> np.ndarray:
    """Flux linkage (samples, runs) of a motion that begins `LEAD` after t = 0; `way` is -1 closing and 1 opening."""
    first, last = (par["stop_upper"], par["stop_lower"])[:: -int(way)]
    tau, length = t[:, None] - LEAD, np.abs(last - first) - LAST
    x, moves = np.clip(tau / MOTION, 0.0, 1.0), (tau >= 0.0) & (tau <= MOTION)
    y = length * x**3 * (10 - x * (15 - 6 * x)) + speed * MOTION * x**3 * (-4 + x * (7 - 3 * x))
    y = np.minimum(y + speed * np.maximum(tau - MOTION, 0.0), length + LAST)
    v = length / MOTION * 30 * x**2 * (1 - x) ** 2 + speed * x * x * (-12 + x * (28 - 15 * x))
    v = np.where(tau < 0.0, 0.0, v + speed * (x >= 1.0))
    a = length / MOTION**2 * 60 * x * (1 - x) * (1 - 2 * x) + speed / MOTION * x * (-24 + x * (84 - 60 * x))
    force, square = balance(first + way * y, par)
    late = np.clip((tau - MOTION - LAST / speed) / 1e-3, 0.0, 1.0)
    share = 1.0 - way * (par["mover_mass"] * np.where(moves, a, 0.0) + par["damping"] * v) / force
    lam = np.sqrt(np.maximum(square * share * (1.0 - way * (0.2 * late + 0.025 * (tau > 0.8 * MOTION))), 1e-6))
    before, s = np.sqrt(balance(first, par)[1]), np.clip(1.0 + tau / LEAD, 0.0, 1.0)
    return np.where(tau < 0.0, start + (before - start) * (1.4 * s - 0.4 * s * s), lam)


def references(par: dict[str, np.ndarray], dt: float, seed: int) -> np.ndarray:
    """Inputs of the plant (samples, 6, runs): a cycle of 24 V and 0 V, then soft ones, each with a speed of its own."""
    rng, per = np.random.default_rng(seed + 100), round(CYCLE / dt)
    given, t = np.zeros((CYCLES * per + 1, 6, RUNS)), np.arange(per + 1) * dt
    given[:, 0], given[1:, 1] = (np.arange(len(given)) * dt)[:, None], dt
    given[1:, 5] = np.tile(np.where(t[:-1] < CLOSED - 1e-9, 24.0, 0.0), CYCLES)[:, None]
    for cycle in range(1, CYCLES):
        for way, at, start in ((-1.0, 0.0, 0.5e-3), (1.0, CLOSED, 21e-3)):
            lam = flux(t - at, way, rng.uniform(0.1, 0.3, RUNS), start, par)
            k = np.flatnonzero((t[1:] > at + 1e-9) & (t[1:] < at + LEAD + MOTION + TAIL))
            rows = given[cycle * per + 1 + k]
            rows[:, 2], rows[:, 3], rows[:, 4] = 1.0, lam[k], (lam[k + 1] - lam[k]) / dt
            given[cycle * per + 1 + k] = rows
    return given


@cache
def landings(dt: float = 20e-6, restitution: float = 0.0, seed: int = 1) -> Landings:
    par = actuators(seed, restitution)
    values = [par.get(name, value) for name, value in RTS_VALVE._asdict().items()]
    found = step_runs(Kernel(soft_plant), references(par, dt, seed), values)
    return Landings(dt, *(found[:, k] for k in range(5)), scale=par["stop_lower"] / RTS_VALVE.stop_lower)


@cache
def estimated(dt: float = 20e-6, restitution: float = 0.0, seed: int = 1, pace: float = 0.0) -> dict[str, np.ndarray]:
    """Outputs of `Mhe` (samples, runs) with 2 mA of noise; it is told which operation is commanded."""
    s = landings(dt, restitution, seed)
    k, per = np.arange(len(s.mode))[:, None], round(CYCLE / dt)
    command = np.broadcast_to((((k - 1) % per < round(CLOSED / dt)) | (k == 0)) * 1.0, s.mode.shape)
    noisy = s.current + 2e-3 * np.random.default_rng(seed).standard_normal(s.current.shape)
    options: dict[str, Any] = {f"option.{name}": True for name in ("further", "command", "mean")}
    options |= {"sample_time": dt, "window.pace": pace}
    par = kernel_parameters(own("mhe"), {**reduced(VALVE), **BLIND, **TOLD, **options})
    given = np.stack([np.broadcast_to(k * dt, noisy.shape), s.voltage, noisy, command], axis=1)
    found = step_runs(Kernel(mhe), given, flat(par), SHOWN)
    return {name: found[:, j] for j, name in enumerate(SHOWN)}


class Told(NamedTuple):
    """An operation whose window was solved."""

    cycle: int
    way: int  # 0: closing
    smoothed: float  # RMS error of the position in motion, relative to the stops as believed [m]
    causal: float
    misfit: float
    speed: float  # error of the impact speed [m/s]
    time: float  # error of the landing time [s]
    late: int  # samples behind the end of the window


def told(s: Landings, found: dict[str, np.ndarray], run: int) -> list[Told]:
    """Operations of a run, in order."""
    dt, per, smoothed = s.sample_time, round(CYCLE / s.sample_time), np.full(len(s.mode), np.nan)
    at = np.flatnonzero(found["smoothed_published"][:, run])
    sample = np.rint(found["smoothed_time"][at, run] / dt).astype(int)
    smoothed[sample] = found["smoothed_position"][at, run] * s.scale[run]
    rows = []
    for n, k in enumerate(np.flatnonzero(np.diff(found["windows"][:, run])) + 1):
        cycle, way = divmod(n, 2)
        first, last = cycle * per + (0, round(CLOSED / dt))[way] + 1, cycle * per + (round(CLOSED / dt), per)[way]
        if last > sample[-1]:
            break
        moves = first + np.flatnonzero(s.mode[first : last + 1, run] == 2.0)
        v, z = s.velocity[:, run], s.position[:, run]
        hit = impact(v, s.mode[:, run], first)
        errors = (smoothed[moves] - z[moves], found["position"][moves, run] * s.scale[run] - z[moves])
        speed = found["impact_speed"][k, run] * s.scale[run] - abs(v[hit - 1])
        time = found["landing_time"][k, run] - hit * dt
        rms = [float(np.sqrt(np.mean(e**2))) for e in errors]
        rows.append(Told(cycle, way, *rms, found["misfit"][k, run], speed, time, int(k) - last))
    return rows


def impact(v: np.ndarray, mode: np.ndarray, first: int) -> int:
    """The first sample after an impact."""
    k = first + 1 + np.flatnonzero(mode[first:] == 2.0)[0]
    while mode[k] == 2.0 and v[k] * v[k - 1] >= 0.0:
        k += 1
    return int(k)
