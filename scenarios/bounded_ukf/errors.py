"""Errors of `BoundedUkf` over noise and over wrong parameters, Figs. 8 and 9 of [UKF], and over the resistance.

The runs are those of the scenario, of one cycle of the valve; all its filters get the same measurements.  The paper
leaves the resistance out of its wrong parameters, and says nothing of landings that are missed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby, product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.workers import Progress
from gapsense.fmi.components import load_component, own
from gapsense.shipped import SCENARIOS
from gapsense.studies.devices import VALVE
from gapsense.studies.runs import Values, after, overlaid, signals

Array = npt.NDArray[np.float64]
Factors = Mapping[str, Array]  # by parameter, of shapes that go with (levels, voltages, runs)

T_S = 20e-6  # [s]
REST, HALF = 10, 500  # samples before the first edge, and of each half of the cycle
SAMPLES = REST + 2 * HALF
SCENARIO = overlaid(SCENARIOS / "bounded_ukf", {"experiment": {"stop": (2 * HALF - 1) * T_S}})
LAST = 50  # samples at the end of each half, in which the plunger has long landed
MISSED = 0.25  # an estimate that is further from the stop there, in strokes, has missed the landing
VOLTAGES = (24.0, 30.0, 36.0)  # [V]
UNSEEN = (21.0, 27.0, 33.0)  # voltages that no tuning was made with [V]
NOISES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)  # sigma_n (37)
ERRORS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05)  # relative, of the parameters
RESISTANCES = (-0.05, -0.02, 0.02, 0.05)  # relative
NOISE = 0.01  # sigma_n of Fig. 9
WRONG = ("coil.turns", "core.reluctance", "core.saturation", "spring.stiffness", "damping", "mover.mass")
RESISTANCE = "coil.resistance"
RIGHT: dict[str, float] = {  # what the filters should believe
    port.name: float(port.start)
    for port in load_component(own("bounded_ukf")).of("parameter")
    if port.name in (*WRONG, RESISTANCE)
}
COMPONENTS = ("ukf", "paper", "ekf", "model")
FILTERS: Mapping[str, tuple[str, Values]] = {  # component, and what is set beside its parameters
    "bounded UKF, robust": ("ukf", {}),
    "bounded UKF, paper": ("paper", {}),
    "bounded EKF": ("ekf", {}),
    "unbounded UKF": ("paper", {"paper.option.filter": "unbounded_ukf"}),
    "open loop": ("model", {}),
}


class Errors(NamedTuple):
    """What the runs of one filter give; the last axis is closing, opening."""

    rmse: Array  # (levels, voltages, runs, 2) [m]; NaN of a filter that has left the device
    missed: npt.NDArray[np.bool_]  # the same shape


Found = Mapping[str, Errors]  # by filter


def noise(seeds: int = 20, progress: Progress = lambda done, total: None) -> Found:
    """Fig. 8: right parameters, all `NOISES`, errors of each seed."""
    sizes = np.broadcast_to(np.array(NOISES)[:, None, None], (len(NOISES), len(VOLTAGES), seeds))
    return _all(sizes, np.arange(len(VOLTAGES) * seeds).reshape(-1, seeds), {}, progress)  # the same at every level


def parameters(
    resistance: float = 0.0, errors: Sequence[float] = ERRORS, progress: Progress = lambda done, total: None
) -> Found:
    """Fig. 9: all 2^6 signs of each of the relative `errors` in six parameters; `resistance` is wrong by as much."""
    signs = np.array([*product((-1.0, 1.0), repeat=len(WRONG))]).T
    factors = dict(zip(WRONG, 1.0 + np.array(errors)[None, :, None, None] * signs[:, None, None]))
    factors["core.saturation"] = factors["coil.turns"] / factors["core.saturation"]  # it is N / k_2
    factors[RESISTANCE] = np.full((1, 1, 1), 1.0 + resistance)
    sizes = np.full((len(errors), len(VOLTAGES), signs.shape[1]), NOISE)
    return _all(sizes, np.arange(1000, 1000 + len(VOLTAGES))[:, None], factors, progress)  # one, as in the paper


def unseen(runs: int = 200, progress: Progress = lambda done, total: None) -> Found:
    """A check of the tuning by cases that it does not know: `UNSEEN` voltages, random errors in all parameters.

    The errors are uniform within +-5 and +-10 %, those of the resistance too, with noise of their own for each run.
    """
    rng, widths = np.random.default_rng(1000), np.array([0.05, 0.10])[:, None, None]
    factors = {name: 1.0 + widths * rng.uniform(-1.0, 1.0, (1, 1, runs)) for name in (*WRONG, RESISTANCE)}
    factors["core.saturation"] = factors["coil.turns"] / factors["core.saturation"]
    sizes = np.full((len(widths), len(UNSEEN), runs), NOISE)
    return _all(sizes, np.arange(2000, 2000 + len(UNSEEN) * runs).reshape(-1, runs), factors, progress, UNSEEN)


def means(voltages: Sequence[float]) -> Array:
    """Mean voltage [V] and current [A] of a cycle at each voltage: (voltages, 2)."""
    asked = [{"drive.square.amplitude": volts} for volts in voltages]
    runs = signals(SCENARIO, None, ["drive.voltage_mean", "valve.current"], asked)
    found = {k: run.mean(axis=0) for k, run in runs if run is not None}
    return np.array([found[k] for k in range(len(asked))])


def draw(volts: float, stds: Array, factors: Mapping[str, float]) -> Values:
    """Values of one run: a voltage, noise that the filters are told, and what they get wrong."""
    noises = {"noise.voltage": float(stds[0]), "noise.current": max(float(stds[1]), 1e-9)}
    believed = {**noises, **{name: right * factors.get(name, 1.0) for name, right in RIGHT.items()}}
    told = {f"{component}.{name}": value for component in COMPONENTS for name, value in believed.items()}
    return {"drive.square.amplitude": volts, **{f"sensor.{name}": value for name, value in noises.items()}, **told}


def _all(
    sizes: Array,
    seeds: npt.NDArray[np.int_],
    factors: Factors,
    progress: Progress,
    voltages: Sequence[float] = VOLTAGES,
) -> Found:
    """Errors of all filters; `sizes` of the noise are (levels, voltages, runs), `seeds` are those of the sensor."""
    scales = means(voltages)
    spread = {name: np.broadcast_to(factor, sizes.shape) for name, factor in factors.items()}
    draws = [
        draw(voltages[at[1]], sizes[at] * scales[at[1]], {name: float(factor[at]) for name, factor in spread.items()})
        for at in np.ndindex(sizes.shape)
    ]
    shifts: list[int] = np.broadcast_to(seeds, sizes.shape).ravel().tolist()
    groups = groupby(sorted(FILTERS, key=lambda title: len(FILTERS[title][1])), key=lambda title: FILTERS[title][1])
    found: dict[str, Errors] = {}
    for options, titles in [(options, [*titles]) for options, titles in groups]:
        asked, before = [{**values, **options} for values in draws], len(found) * sizes.size
        tell = after(progress, before, len(FILTERS) * sizes.size, len(titles))
        judged = _judged([FILTERS[title][0] for title in titles], asked, shifts, tell)
        for title, (rmse, missed) in zip(titles, judged):
            found[title] = Errors(rmse.reshape(*sizes.shape, 2), missed.reshape(*sizes.shape, 2))
    return {title: found[title] for title in FILTERS}


def _judged(
    components: Sequence[str], draws: Sequence[Values], seeds: Sequence[int], tell: Callable[[int], None]
) -> Iterator[tuple[Array, npt.NDArray[np.bool_]]]:
    """For each component the errors of all runs in both halves, (runs, 2), and whether landings are missed."""
    rmse, last = (np.full((len(components), len(draws), 2), np.nan) for _ in range(2))
    names = [*(f"{component}.position" for component in components), "valve.position"]
    for done, (k, run) in enumerate(signals(SCENARIO, None, names, draws, seeds), 1):
        if run is not None:
            halves = np.split((run[REST:, :-1] - run[REST:, -1:]).T, 2, axis=1)
            rmse[:, k] = np.stack([np.sqrt(np.mean(half**2, axis=1)) for half in halves], axis=-1)
            last[:, k] = np.stack([np.mean(np.abs(half[:, -LAST:]), axis=1) for half in halves], axis=-1)
        tell(done)
    return zip(rmse, ~(last <= MISSED * (VALVE.stop_upper - VALVE.stop_lower)))  # true where there is none
