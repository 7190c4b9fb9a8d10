"""Errors of `BoundedUkf` over noise and over wrong parameters, Figs. 8 and 9 of [UKF], and over the resistance.

One cycle of the valve at each voltage; then all noise levels, seeds and sign combinations of the filter at once.  The
paper leaves the resistance out of its wrong parameters, and says nothing of landings that are missed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.workers import Progress
from gapsense.actuators import solenoid_valve
from gapsense.estimators import ukf
from gapsense.estimators.valve_model import Filter, Tuned
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import stepped
from gapsense.studies.devices import VALVE, driven

Array = npt.NDArray[np.float64]
Factors = Mapping[str, Any]  # by the field of a parameter: numbers or arrays (levels, voltages, runs)

T_S = 20e-6  # [s]
REST, HALF = 10, 500  # samples before the first edge, and of each half of the cycle
SAMPLES = REST + 2 * HALF
LAST = 50  # samples at the end of each half, in which the plunger has long landed
MISSED = 0.25  # an estimate that is further from the stop there, in strokes, has missed the landing
VOLTAGES = (24.0, 30.0, 36.0)  # [V]
UNSEEN = (21.0, 27.0, 33.0)  # voltages that no tuning was made with [V]
NOISES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)  # sigma_n (37)
ERRORS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05)  # relative, of the parameters
RESISTANCES = (-0.05, -0.02, 0.02, 0.05)  # relative
NOISE = 0.01  # sigma_n of Fig. 9
WRONG = ("coil_turns", "core_reluctance", "core_saturation", "spring_stiffness", "damping", "mover_mass")
PLANT = VALVE._replace(coil_resistance=77.5, gap_law=solenoid_valve.GapLaw.table)
NOMINAL: ukf.Parameters = kernel_parameters(own("bounded_ukf"), {})  # what is right
FILTERS: Mapping[str, Factors] = {
    "bounded UKF, robust": {},
    "bounded UKF, paper": {"option_tuning": Tuned.paper},
    "bounded EKF": {"option_filter": Filter.bounded_ekf},
    "unbounded UKF": {"option_filter": Filter.unbounded_ukf, "option_tuning": Tuned.paper},
    "open loop": {"option_filter": Filter.open_loop},
}


class Cycle(NamedTuple):
    """One cycle of the valve."""

    voltage: Array  # (samples,), of each sample, held until the next
    current: Array
    position: Array


class Errors(NamedTuple):
    """What the runs of one filter give; the last axis is closing, opening."""

    rmse: Array  # (levels, voltages, runs, 2) [m]
    missed: npt.NDArray[np.bool_]  # the same shape


Found = Mapping[str, Errors]  # by filter


def noise(seeds: int = 20, progress: Progress = lambda done, total: None) -> Found:
    """Fig. 8: right parameters, all `NOISES`, errors of each seed."""
    shape = (len(NOISES), len(VOLTAGES), seeds)
    sizes = np.broadcast_to(np.array(NOISES)[:, None, None], shape)
    drawn = np.random.default_rng(8).standard_normal((2, SAMPLES, len(VOLTAGES), seeds))  # same at every level
    return _all(sizes, drawn[:, :, None], {}, progress)


def parameters(
    resistance: float = 0.0, errors: Sequence[float] = ERRORS, progress: Progress = lambda done, total: None
) -> Found:
    """Fig. 9: all 2^6 signs of each of the relative `errors` in six parameters; `resistance` is wrong by as much."""
    signs = np.array([*product((-1.0, 1.0), repeat=len(WRONG))]).T
    factors = dict(zip(WRONG, 1.0 + np.array(errors)[None, :, None, None] * signs[:, None, None]))
    factors["core_saturation"] = factors["coil_turns"] / factors["core_saturation"]  # it is N / k_2
    factors["coil_resistance"] = np.full((1, 1, 1), 1.0 + resistance)
    shape = (len(errors), len(VOLTAGES), signs.shape[1])
    drawn = np.random.default_rng(9).standard_normal((2, SAMPLES, 1, len(VOLTAGES), 1))  # one, as in the paper
    return _all(np.full(shape, NOISE), drawn, factors, progress)


def unseen(runs: int = 200, progress: Progress = lambda done, total: None) -> Found:
    """A check of the tuning by cases that it does not know: `UNSEEN` voltages, random errors in all parameters.

    The errors are uniform within +-5 and +-10 %, those of the resistance too, with noise of their own for each run.
    """
    rng, widths = np.random.default_rng(1000), np.array([0.05, 0.10])[:, None, None]
    factors = {name: 1.0 + widths * rng.uniform(-1.0, 1.0, (1, 1, runs)) for name in (*WRONG, "coil_resistance")}
    factors["core_saturation"] = factors["coil_turns"] / factors["core_saturation"]
    shape = (len(widths), len(UNSEEN), runs)
    drawn = rng.standard_normal((2, SAMPLES, 1, *shape[1:]))
    return _all(np.full(shape, NOISE), drawn, factors, progress, UNSEEN)


def _all(
    sizes: Array, drawn: Array, factors: Factors, progress: Progress, voltages: Sequence[float] = VOLTAGES
) -> Found:
    """Errors of all filters; `sizes` (levels, voltages, runs) are those of the noise, `drawn` is noise of size 1."""
    cycles = [*map(simulated, voltages)]
    return {
        name: _errors(cycles, sizes, drawn, factors, options, progress, k * SAMPLES)
        for k, (name, options) in enumerate(FILTERS.items())
    }


def _errors(
    cycles: Sequence[Cycle], sizes: Array, drawn: Array, factors: Factors, options: Factors, tell: Progress, before: int
) -> Errors:
    """Errors of one filter; `before` samples of others are done."""
    stds = [sizes * np.array([np.mean(x) for x in xs])[:, None] for xs in [*zip(*cycles)][:2]]
    par = NOMINAL._asdict() | {"noise_voltage": stds[0], "noise_current": np.maximum(stds[1], 1e-9), **options}
    par |= {name: par[name] * factor for name, factor in factors.items()}
    flat = [v if isinstance(v, list) else np.broadcast_to(v, sizes.shape).ravel() for v in par.values()]
    true = np.stack(cycles, axis=-1)[..., None]  # (quantities, samples, voltages, 1)
    inputs = np.zeros((SAMPLES, len(ukf.Inputs._fields), sizes.size))  # the last one is not wired
    for row, x, s, d in zip(inputs.swapaxes(0, 1), true, stds, drawn):
        row[:] = (x[:, None] + s * d).reshape(SAMPLES, -1)
    found = stepped(Kernel(ukf), inputs, flat, ("position",))
    error = found.reshape(SAMPLES, *sizes.shape) - true[2][:, None]
    tell(before + SAMPLES, SAMPLES * len(FILTERS))
    halves = np.split(error[REST:], 2)
    rmse = np.stack([np.sqrt(np.mean(half**2, axis=0)) for half in halves], axis=-1)
    last = np.stack([np.mean(np.abs(half[-LAST:]), axis=0) for half in halves], axis=-1)
    return Errors(rmse, last > MISSED * (PLANT.stop_upper - PLANT.stop_lower))


def simulated(volts: float) -> Cycle:
    """Rest, voltage on, voltage off: the valve with the fringing gap table."""
    voltage = np.repeat([0.0, volts, 0.0], [REST, HALF, HALF])
    return Cycle(voltage, *driven(solenoid_valve, PLANT, voltage, T_S, "current", "position").T)
