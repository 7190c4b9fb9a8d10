"""RMS deviations of `HybridEkf` over time, noise and wrong parameters: Figs. 8-11 of [HEKF] and beyond.

The runs are those of the scenario, from shortly before its edge on; all its filters get the same measurements.  The
noise of a seed is the same at every level but for its size, and so are its parameter errors.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.workers import Progress
from gapsense.cosim import load
from gapsense.shipped import SCENARIOS
from gapsense.studies.runs import Values, after, overlaid, signals

Array = npt.NDArray[np.float64]

T_S = 1e-4  # [s]
EDGE, SAMPLES = 1000, 2000  # of the voltage; the edge at 0.5 s follows a rest, of which 0.1 s is enough
SCENARIO = overlaid(SCENARIOS / "pot_magnet", {"experiment": {"start": 0.4, "stop": 0.4 + (SAMPLES - 1) * T_S}})
LEVELS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)  # noise of the current [A]
ERRORS = 11  # stream of random numbers; the tuning was chosen on others, 1 and 2
FILTERS = {"robust": "robust", "paper": "paper", "none": "open_loop"}  # components by their tuning
STEPS = ("0 to 24 V", "24 to 0 V")
VARIANTS = {"consistent": (None, "off"), "printed": ("printed", "printed_off")}  # for each step
WRONG = ("coil.resistance", "pole.area", "core.length", "mover.mass", "current.on", "current.off")
STATES = {"current": "current_estimated", "position": "position", "velocity": "velocity", "mode": "mode"}


class Case(NamedTuple):
    """Some runs of one filter."""

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
    """Both steps of the voltage, right and wrong parameters, all tunings; `progress` gets runs done and in all."""
    if orientation not in VARIANTS:
        raise ValueError(f"orientation `{orientation}` found, {' or '.join(VARIANTS)} expected. Correct it.")
    if seeds < 1 or not 0.0 <= mismatch < 1.0:
        raise ValueError(
            f"{seeds} seeds and a mismatch of {mismatch:g}: at least 1, and from 0 to below 1, are needed."
        )
    parts = [*product(zip(STEPS, VARIANTS[orientation]), dict.fromkeys((0.0, mismatch)))]
    runs, found = len(LEVELS) * seeds, {}
    for k, ((step, variant), width) in enumerate(parts):
        judged = deviations(variant, seeds, width, after(progress, k * runs, len(parts) * runs))
        found.update({Case(step, width, tuning): one for tuning, one in judged.items()})
    return found


def draws(variant: str | None, seeds: int, mismatch: float) -> list[Values]:
    """Values of all runs, the seeds at each level: its noise, which the filters are told, and what they get wrong.

    Their parameters are wrong by up to the part `mismatch`, each by itself, evenly distributed.
    """
    believed = load(SCENARIO, variant).components["robust"].values
    errors = mismatch * np.random.default_rng(ERRORS).uniform(-1.0, 1.0, (seeds, len(WRONG)))
    factors = [dict(zip((*WRONG, "coil.resistance_upper"), (1.0 + np.append(e, e[0])).tolist())) for e in errors]
    return [
        {
            "sensor.noise.voltage": 0.0,
            "sensor.noise.current": level,
            **{f"{name}.noise.current": level for name in FILTERS.values()},
            **{f"{name}.{p}": float(believed[p]) * f for name in FILTERS.values() for p, f in of_seed.items()},
        }
        for level in LEVELS
        for of_seed in factors
    ]


def deviations(
    variant: str | None, seeds: int, mismatch: float = 0.0, tell: Callable[[int], None] = lambda done: None
) -> dict[str, Deviations]:
    """Deviations of each tuning from the truth, for all `LEVELS` and seeds; `tell` gets the runs that are done."""
    names = [f"{name}.{state}" for name in FILTERS.values() for state in STATES.values()]
    names += [f"magnet.{state}" for state in STATES]
    squares = np.zeros((len(LEVELS), SAMPLES, len(FILTERS), len(STATES)))
    wrong = np.zeros((len(LEVELS), seeds, len(FILTERS)))
    asked = draws(variant, seeds, mismatch)
    shifts = [*range(seeds)] * len(LEVELS)
    for done, (k, run) in enumerate(signals(SCENARIO, variant, names, asked, shifts), 1):
        assert run is not None, asked[k]
        level, seed = divmod(k, seeds)
        *estimated, true = np.split(run, len(FILTERS) + 1, axis=1)
        error = np.stack(estimated, axis=1) - true[:, None]
        squares[level] += error**2
        wrong[level, seed] = np.mean(error[EDGE:, :, -1] != 0.0, axis=0)
        tell(done)
    rmsd = np.sqrt(squares / seeds)
    total = np.sqrt(np.mean(rmsd[:, EDGE:] ** 2, axis=1))
    return {tuning: Deviations(rmsd[:, :, k], total[:, k], wrong[..., k]) for k, tuning in enumerate(FILTERS)}
