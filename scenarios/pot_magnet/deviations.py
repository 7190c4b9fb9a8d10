"""RMS deviations of `HybridEkf` over time, noise and wrong parameters: Figs. 8-11 of [HEKF] and beyond.

One run of the plant for each step of the voltage; then all seeds and noise levels of the filter at once.  The noise of
a seed is the same at every level but for its size, and so are its parameter errors.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.workers import Progress
from gapsense.actuators import pot_magnet
from gapsense.estimators import hybrid_ekf
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import stepped
from gapsense.kernels.layout import flat, names
from gapsense.studies.devices import POT_MAGNET, POT_MAGNET_PRINTED, driven

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
SEEN = 4  # the first outputs: as the states of `Truth`
NOMINAL: hybrid_ekf.Parameters = kernel_parameters(own("hybrid_ekf"), {})


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
    progress: Progress = lambda done, total: None,
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
    cases = [Case(*key) for key in product(STEPS, dict.fromkeys((0.0, mismatch)), TUNINGS)]
    found = {}
    for done, case in enumerate(cases):
        part = partial(lambda before, k, total: progress(before * total + k, len(cases) * total), done)
        found[case] = deviations(
            runs[case.step], plant, case.tuning, seeds=seeds, mismatch=case.mismatch, progress=part
        )
    return found


def truth(plant: pot_magnet.Parameters, is_rising: bool) -> Truth:
    """The plant during a step of the voltage from 0 V to 24 V, or back from there."""
    voltage = np.where((np.arange(SAMPLES) >= EDGE) == is_rising, HIGH, 0.0)
    return Truth(voltage, driven(pot_magnet, plant, voltage, T_S, "current", "position", "velocity", "mode"))


def believed(plant: pot_magnet.Parameters, errors: Array, noise: Array, tuning: str) -> list[Any]:
    """Flat parameters of all runs: those of the plant, of which `WRONG` are multiplied by 1 + `errors` (runs, 6)."""
    known = {name: value for name, value in plant._asdict().items() if name in NOMINAL._fields}
    for name, factor in zip((*WRONG, "coil_resistance_upper"), (1.0 + errors[:, [*range(len(WRONG)), 0]]).T):
        known[name] = known[name] * factor
    chosen = {"sample_time": T_S, "tuning": hybrid_ekf.Tuned[tuning], "noise_current": noise}
    return flat(NOMINAL._replace(**known, **chosen))


def deviations(
    run: Truth,
    plant: pot_magnet.Parameters,
    tuning: str,
    *,
    seeds: int = 100,
    mismatch: float = 0.0,
    progress: Progress = lambda done, total: None,
) -> Deviations:
    """Deviations of the filter from the truth of a plant, for all `LEVELS` and seeds at once.

    Parameters of the filter are wrong by up to the part `mismatch`, each by itself, evenly distributed.
    """
    rng = np.random.default_rng(ERRORS)
    errors = mismatch * rng.uniform(-1.0, 1.0, (seeds, len(WRONG)))
    noise = np.array([np.random.default_rng([NOISE, seed]).standard_normal(SAMPLES) for seed in range(seeds)]).T
    levels = np.repeat(LEVELS, seeds)
    par = believed(plant, np.tile(errors, (len(LEVELS), 1)), levels, tuning)
    current = run.states[:, :1] + np.tile(noise, len(LEVELS)) * levels
    inputs = np.stack([np.broadcast_to(run.voltage[:, None], current.shape), current], axis=1)
    found = stepped(Kernel(hybrid_ekf), inputs, par, names(hybrid_ekf.Outputs)[:SEEN])
    progress(SAMPLES, SAMPLES)
    error = found.reshape(SAMPLES, SEEN, len(LEVELS), seeds) - run.states[:, :, None, None]
    rmsd = np.sqrt(np.mean(error**2, axis=3)).transpose(2, 0, 1)
    total = np.sqrt(np.mean(rmsd[:, EDGE:] ** 2, axis=1))
    return Deviations(rmsd, total, np.mean(error[EDGE:, 3] != 0.0, axis=0))
