"""RMS deviations of `HybridEkf` over time, noise and wrong parameters: Figs. 8-11 of [HEKF] and beyond.

One run of the plant for each step of the voltage; then all seeds and noise levels at once by the numpy code of the
filter.  The noise of a seed is the same at every level but for its size, and so are its parameter errors.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.actuators import pot_magnet
from gapsense.estimators import hybrid_ekf
from gapsense.kernel import Kernel
from gapsense.records import flat
from gapsense.studies.devices import POT_MAGNET, POT_MAGNET_PRINTED

Array = npt.NDArray[np.float64]

T_S = 1e-4  # [s]
EDGE, SAMPLES = 1000, 2000  # of the voltage; the paper's edge at 0.5 s follows a rest, of which 0.1 s is enough
HIGH = 24.0  # [V]
LEVELS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)  # noise of the current [A]
ERRORS, NOISE = 11, 12  # streams of random numbers; the tuning was chosen on others, 1 and 2
TUNINGS = tuple(choice.name for choice in hybrid_ekf.Tuned)
STEPS = ("0 to 24 V", "24 to 0 V")
PLANTS = {"consistent": POT_MAGNET, "printed": POT_MAGNET_PRINTED}
WRONG = ("coil_resistance", "pole_area", "core_length", "mover_mass", "current_on", "current_off")
SEEN = ("current_estimated", "position", "velocity", "mode")  # of the outputs, as in the states of `Truth`
TUNING = {  # start values of the component
    "sub_steps": 2.0,
    "landing_band": 0.03,
    "process_current": 3e-4,
    "process_current_moving": 1e-3,
    "process_position": 1e-7,
    "process_velocity": 3e-4,
    "release_position_std": 1e-6,
    "release_velocity_std": 1e-3,
    "prior_current": 0.0,
    "prior_current_std": 1e-3,
    "prior_position": 0.0,
    "health_samples": 50.0,
    "health_limit": 4.0,
}


class Truth(NamedTuple):
    """One run of the plant, at multiples of `T_S`."""

    voltage: Array  # of each sample, held until the next
    states: Array  # (samples, 4): i, s, v, q


class Case(NamedTuple):
    """One batch of runs."""

    step: str  # of `STEPS`
    mismatch: float
    tuning: str


class Deviations(NamedTuple):
    """What the runs of one tuning give."""

    rmsd: Array  # (levels, samples, 4): of i, s, v, q over the seeds
    total: Array  # (levels, 4): over the seeds and the samples from the edge on
    wrong: Array  # (levels, seeds): share of these samples with the wrong mode


def study(
    orientation: str = "consistent",
    seeds: int = 100,
    mismatch: float = 0.05,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[Case, Deviations]:
    """Both steps of the voltage, right and wrong parameters, all tunings; `progress` gets samples done and in all."""
    if orientation not in PLANTS:
        raise ValueError(f"orientation `{orientation}` found, {' or '.join(PLANTS)} expected. Correct it.")
    if seeds < 1 or not 0.0 <= mismatch < 1.0:
        raise ValueError(
            f"{seeds} seeds and a mismatch of {mismatch:g}: at least 1, and from 0 to below 1, are needed."
        )
    plant = PLANTS[orientation]
    runs = {step: truth(plant, step == STEPS[0]) for step in STEPS}
    widths = dict.fromkeys((0.0, mismatch))
    cases = [Case(*key) for key in product(STEPS, widths, TUNINGS)]

    def part(done: int) -> Callable[[int, int], None]:
        return lambda k, total: progress(done * total + k, len(cases) * total)

    return {
        case: deviations(runs[case.step], plant, case.tuning, seeds=seeds, mismatch=case.mismatch, progress=part(done))
        for done, case in enumerate(cases)
    }


def truth(plant: pot_magnet.Parameters, is_rising: bool) -> Truth:
    """The plant during a step of the voltage from 0 V to 24 V, or back from there."""
    kernel = Kernel(pot_magnet)
    voltage = np.where((np.arange(SAMPLES) >= EDGE) == is_rising, HIGH, 0.0)
    state, outputs = kernel.initial(pot_magnet.Inputs(0.0, 0.0, 0.0), plant)
    rows = [outputs]
    for k, u in enumerate(voltage[:-1].tolist(), 1):
        state, outputs = kernel.step(state, pot_magnet.Inputs(k * T_S, T_S, u), plant)
        rows.append(outputs)
    return Truth(voltage, np.array([[o.current, o.position, o.velocity, o.mode] for o in rows]))


def believed(plant: pot_magnet.Parameters, errors: Array, noise: Array, tuning: str) -> list[Any]:
    """Flat parameters of all runs: those of the plant, of which `WRONG` are multiplied by 1 + `errors` (runs, 6)."""
    known = {name: value for name, value in plant._asdict().items() if name in hybrid_ekf.Parameters._fields}
    for name, factor in zip(WRONG, 1.0 + errors.T):
        known[name] = known[name] * factor
    known["coil_resistance_upper"] = known["coil_resistance_upper"] * (1.0 + errors[:, 0])
    chosen = {"sample_time": T_S, "tuning": hybrid_ekf.Tuned[tuning], "noise_current": noise}
    return flat(hybrid_ekf.Parameters(**{**known, **TUNING, **chosen}))


def deviations(
    run: Truth,
    plant: pot_magnet.Parameters,
    tuning: str,
    *,
    seeds: int = 100,
    mismatch: float = 0.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Deviations:
    """Deviations of the filter from the truth, for all `LEVELS` and seeds at once.

    Parameters
    ----------
    run, plant
        The truth, and the plant that it comes from.
    tuning : str
        One of `TUNINGS`.
    seeds : int
        Number of runs at each level.
    mismatch : float
        Parameters of the filter are wrong by up to this part, each by itself, evenly distributed.
    progress : callable
        Gets the samples done and their total.
    """
    rng = np.random.default_rng(ERRORS)
    errors = mismatch * rng.uniform(-1.0, 1.0, (seeds, len(WRONG)))
    noise = np.array([np.random.default_rng([NOISE, seed]).standard_normal(SAMPLES) for seed in range(seeds)]).T
    levels, runs = np.repeat(LEVELS, seeds), len(LEVELS) * seeds
    par = believed(plant, np.tile(errors, (len(LEVELS), 1)), levels, tuning)
    found = np.empty((SAMPLES, len(SEEN), runs))
    kernel, state = Kernel(hybrid_ekf), None
    for k, u in enumerate(run.voltage):
        inputs = (u, run.states[k, 0] + np.tile(noise[k], len(LEVELS)) * levels)
        step = kernel.initial_batch(inputs, par, runs) if state is None else kernel.step_batch(state, inputs, par, runs)
        state, outputs = step[0], hybrid_ekf.Outputs(*step[1])
        for row, name in zip(found[k], SEEN):
            row[:] = getattr(outputs, name)
        progress(k + 1, SAMPLES)
    error = found.reshape(SAMPLES, len(SEEN), len(LEVELS), seeds) - run.states[:, :, None, None]
    rmsd = np.sqrt(np.mean(error**2, axis=3)).transpose(2, 0, 1)
    total = np.sqrt(np.mean(rmsd[:, EDGE:] ** 2, axis=1))
    return Deviations(rmsd, total, np.mean(error[EDGE:, 3] != 0.0, axis=0))
