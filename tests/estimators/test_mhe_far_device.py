"""`Mhe` on devices far from the one told: another physics with 0.3 to 3 times the losses, all else up to 10 % off.

What was mended was found on seeds 1 and 12 of such draws; these here chose nothing.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from lossy_valve import T_S
from mhe_signals import blind, rows, run

from gapsense.actuators import play_actuator
from gapsense.estimators import readings
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import step_runs

PLAY = kernel_parameters(own("play_actuator"), {})
WRONG = ("mover_mass", "spring_stiffness", "damping", "gap_slope", "coil_resistance", "core_reluctance",
         "core_saturation")  # fmt: skip
LOSSES = ("hysteresis_amplitude", "eddy_fast", "eddy_slow")
OPERATIONS, FIRST, HALF, LEAD = 20, 6, 500, 50  # of each run, the first that counts, samples of each, and before


class Played(NamedTuple):
    """Signals (samples, runs) of closings and openings in turn; edges half-way between samples."""

    voltage: np.ndarray
    current: np.ndarray
    position: np.ndarray
    is_moving: np.ndarray


@cache
def played(seed: int, runs: int, volts: tuple[float, float] = (24.0, 32.0)) -> Played:
    rng = np.random.default_rng(seed)
    par = {name: np.full(runs, float(value)) for name, value in PLAY._asdict().items()}
    for name in WRONG:
        par[name] = par[name] * (1.0 + rng.uniform(-0.1, 0.1, runs))
    for name in LOSSES:
        par[name] = par[name] * np.exp(rng.uniform(np.log(0.3), np.log(3.0), runs))
    par["spring_rest"] = PLAY.stop_lower + (PLAY.spring_rest - PLAY.stop_lower) * (1.0 + rng.uniform(-0.1, 0.1, runs))
    k = np.arange(2 * (LEAD + OPERATIONS * HALF)) - 2 * LEAD + 2
    level = np.where((k > 0) & ((k - 1) // (2 * HALF) % 2 == 0), 1.0, 0.0)[:, None] * rng.uniform(*volts, runs)
    dt, shape = 0.5 * T_S, level.shape
    given = np.stack([np.broadcast_to(k[:, None] * dt, shape), np.full(shape, dt), level], axis=1)
    found = step_runs(Kernel(play_actuator), given, tuple(par.values()), ("current", "position", "mode"))[::2]
    noise = rng.standard_normal((2, *found[:, 0].shape))
    return Played(level[::2] + 30e-3 * noise[0], found[:, 0] + 2e-3 * noise[1], found[:, 1], found[:, 2] == 2.0)


@cache
def wrong_operations(seed: int, runs: int) -> np.ndarray:
    """Whether each (run, operation) has more than 100 um in motion, root mean square."""
    s, wrong = played(seed, runs), np.zeros((runs, OPERATIONS), bool)
    for n in range(runs):
        error = run(blind(), rows(s.voltage[:, n], s.current[:, n]))["position"] - s.position[:, n]
        for k in range(OPERATIONS):
            of = slice(LEAD + k * HALF, LEAD + (k + 1) * HALF)
            wrong[n, k] = np.sqrt(np.mean(error[of][s.is_moving[of, n]] ** 2)) > 100e-6
    return wrong[:, FIRST:]


@pytest.mark.slow
def test_it_learns_a_device_whose_first_windows_nothing_explains() -> None:
    """A first window that was not explained was the end of the search: 4 of 40 devices stayed wrong for good."""
    wrong = wrong_operations(4, 40)
    assert wrong.mean() < 0.01 and not wrong[:, -4:].any()


def test_a_device_that_is_not_learnt_yet_is_no_healthy_one() -> None:
    """Each of the samples that were wrong in the first operation had `health` 1."""
    s, first, wrong = played(51, 20), slice(LEAD, LEAD + HALF), 0
    for n in range(20):
        found = run(blind(), rows(s.voltage[:, n], s.current[:, n]))
        is_wrong = (np.abs(found["position"] - s.position[:, n]) > 100e-6)[first]
        wrong += int(is_wrong.sum())
        assert not np.any(found["health"][first][is_wrong])
        is_unlearnt = (found["health_causes"].astype(int) & int(readings.UNLEARNT)) > 0
        assert np.all(is_unlearnt[first]) and not is_unlearnt[: LEAD - 1].any()
        assert not is_unlearnt[LEAD + 9 * HALF :].any()
    assert wrong > 500


def test_few_wrong_operations_are_silent_while_other_losses_are_learnt() -> None:
    """38 % of them: the first windows were trusted too much, and the second to sixth opening came late."""
    s, wrong, silent = played(8301, 40), 0, 0
    for n in range(40):
        found = run(blind(), rows(s.voltage[:, n], s.current[:, n]))
        is_wrong = (np.abs(found["position"] - s.position[:, n]) > 100e-6)[LEAD:].reshape(OPERATIONS, HALF)
        is_silent = is_wrong & (found["health"] > 0.0)[LEAD:].reshape(OPERATIONS, HALF)
        wrong, silent = wrong + int(is_wrong.any(axis=1).sum()), silent + int(is_silent.any(axis=1).sum())
    assert 50 < wrong < 130 and silent <= 0.05 * wrong


def test_little_of_the_wrong_time_is_silent_at_low_reserve() -> None:
    """29 % on seed 11: an operation was judged only once four were explained, and a search went on for cycles."""
    s, wrong, silent = played(31, 40, (21.0, 21.0)), 0, 0
    for n in range(40):
        found = run(blind(), rows(s.voltage[:, n], s.current[:, n]))
        is_wrong = (np.abs(found["position"] - s.position[:, n]) > 100e-6)[LEAD + FIRST * HALF :]
        wrong += int(is_wrong.sum())
        silent += int((is_wrong & (found["health"][LEAD + FIRST * HALF :] > 0.0)).sum())
    assert wrong > 1000 and silent <= 0.05 * wrong


@pytest.mark.slow
def test_few_operations_of_far_devices_are_wrong() -> None:
    """3.3 % of the operations had more than 100 um before, and ten devices to the end."""
    wrong = wrong_operations(101, 200)
    assert wrong.mean() < 0.005 and not wrong[:, -4:].any()
