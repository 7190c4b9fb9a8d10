"""`Mhe` with lost and wild readings, and what must hold for any input."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mhe_plant import CYCLE, START, T_S, Errors, errors, learnt, noisy, plant, says
from mhe_signals import KERNEL, blind, rows, run

from gapsense.estimators import readings
from gapsense.estimators.mhe.mhe import Held, _hold

THIRD = START + 2 * CYCLE  # its motions are in samples 33 to 132 and 563 to 700 of a cycle
PLACES = [60, 110, 200, 650, 900]


def changed(signal: np.ndarray, where: slice, value: float) -> np.ndarray:
    other = signal.copy()
    other[where] = value
    return other


@cache
def undisturbed() -> Errors:
    s = plant()
    return errors(run(blind(), rows(s.voltage, noisy(s))), s)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("value", [np.nan, np.inf, -10.0, 3.0, 1.0])
def test_one_lost_or_wild_current_is_skipped(place: int, value: float) -> None:
    """One that stays in range is told by its neighbours, and they by it."""
    s, at = plant(), THIRD + place
    found = run(blind(), rows(s.voltage, changed(noisy(s), slice(at, at + 1), value)))
    np.testing.assert_array_less(errors(found, s), undisturbed().causal + 0.5)
    lost = np.flatnonzero(says(found, readings.LOST))
    assert set(lost) in ({at}, {at, at + 1, at + 2}) and np.all(found["health"][lost] == 0.0)
    assert found["health"][learnt(found) :].sum() == s.mode.size - learnt(found) - lost.size


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e3])
def test_lost_voltages_are_held(place: int, value: float) -> None:
    s, at = plant(), THIRD + place
    found = run(blind(), rows(changed(s.voltage, slice(at, at + 3), value), noisy(s)))
    assert errors(found, s).causal < 8.5
    np.testing.assert_array_equal(np.flatnonzero(says(found, readings.LOST)), [at, at + 1, at + 2])


@pytest.mark.parametrize("length", [300, CYCLE])
def test_without_currents_it_follows_the_voltage(length: int) -> None:
    """A motion, or a whole cycle."""
    s, lost = plant(), slice(THIRD, THIRD + length)
    found = run(blind(), rows(s.voltage, changed(noisy(s), lost, np.nan)))
    assert np.all(says(found, readings.LOST)[lost]) and found["health"][-1] == 1.0
    assert errors(found, s).causal < 8.5 and np.all(np.isfinite(found["smoothed_position"]))


@pytest.mark.parametrize("lost", [slice(0, 6), slice(0, 100)], ids=["edge", "motion"])
def test_a_lost_edge_costs_its_operation(lost: slice) -> None:
    """The voltage is held at 0 V while the valve opens; the next cycle is as good as before."""
    s = plant()
    at = slice(THIRD + lost.start, THIRD + lost.stop)
    found = run(blind(), rows(changed(s.voltage, at, np.nan), noisy(s)))
    assert errors(found, s).causal > 20.0
    rms = [
        np.sqrt(np.mean((found["position"] - s.position)[k : k + CYCLE][s.mode[k : k + CYCLE] == 2.0] ** 2))
        for k in range(THIRD + CYCLE, s.mode.size, CYCLE)
    ]
    assert max(rms) < 14e-6 and np.any(found["health"][THIRD + 100 :] == 0.0) and found["health"][-1] == 1.0


# any input

VALUES = st.sampled_from([0.0, 30.0, -30.0, 1e-300, 99.0, -99.0, 1e9, np.nan, np.inf, -np.inf, 0.3, 4.0])


@given(
    st.lists(st.tuples(VALUES, VALUES, VALUES, st.integers(1, 400)), min_size=3, max_size=12),
    st.sampled_from([1e-5, 2e-5, 1e-3]),
    st.sampled_from([0.0, 1.0]),
    st.sampled_from([0.0, 1.0]),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=40)
def test_any_input_gives_finite_outputs(
    levels: list[tuple[float, float, float, int]], dt: float, command: float, further: float, seed: int
) -> None:
    """Held values with noise and gaps; the stops hold, and a smoothed sample is not published twice."""
    held = np.concatenate([np.tile(values, (n, 1)) for *values, n in levels])
    noise = np.random.default_rng(seed).standard_normal(held.shape)
    voltage, current, commands = (held + noise * [0.1, 0.05, 0.0]).T
    par = blind(sample_time=dt, window_tail=max(2e-3, 2.0 * dt), option_command=command, option_further=further)
    found = run(par, rows(voltage, current, commands, dt))
    assert all(np.all(np.isfinite(values)) for values in found.values())
    assert np.all((found["position"] >= par.stop_lower) & (found["position"] <= par.stop_upper))
    times = found["smoothed_time"][found["smoothed_published"] > 0.0]
    assert np.all(np.diff(times) > 0.5 * dt) and np.all(times >= -1e-9) and np.all(times <= voltage.size * dt)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=5)
def test_the_python_code_never_raises(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scalar, par = KERNEL.scalar, tuple(blind())
    held = rng.choice([0.0, 30.0, -30.0, 1e9, np.nan, -np.inf, 4.0, 1e-300], (8, 3)).repeat(120, axis=0)
    given_ = rows(*(held + rng.standard_normal(held.shape) * 0.1).T).tolist()
    state, outputs = scalar["initial"](given_[0], par)
    for row in given_[1:]:
        state, outputs = scalar["step"](state, row, par)
        assert all(map(math.isfinite, outputs))


@pytest.mark.parametrize("rest", [1.0, 1.005])
def test_a_long_rest_teaches_nothing(rest: float) -> None:
    """A second at rest before the first operation; how the windows lie then, costs up to two cycles."""
    s, n = plant(), round(rest / T_S)
    current = 2e-3 * np.random.default_rng(5).standard_normal(n)
    found = run(blind(), rows(np.r_[np.zeros(n), s.voltage], np.r_[current, noisy(s)]))
    assert found["resistance"][n] == pytest.approx(48.0, rel=1e-6)
    assert np.all(found["health"][learnt(found, n + START) :] == 1.0)
    assert np.all(found["position"][: n + START] == s.position[0])
    late = slice(n + START + 3 * CYCLE, None)
    moving = s.mode[START + 3 * CYCLE :] == 2.0
    error = (found["position"][late] - s.position[START + 3 * CYCLE :])[moving]
    assert np.sqrt(np.mean(error**2)) < 12e-6


def test_noise_is_no_offset() -> None:
    """With 20 mA of noise the zero of 40 rests of 4 ms is off by 0.7 mA; it was by 3.5 mA, that of 16 samples."""
    par = blind()._replace(sample_time=20e-6, window_tail=6e-3, noise_current=20e-3, option_zero=1.0)
    chance, zeros = np.random.default_rng(1), []
    for _ in range(40):
        held = Held(held_level=0.0, held_voltage=0.0)
        for u in [*[0.0] * 510, 24.0, *[0.0] * 510, 24.0]:
            held = _hold(held, u, chance.normal(0.0, 20e-3), par)
        zeros.append(held.zero)
    assert np.std(zeros) < 1.5e-3
    for u in [*[0.0] * 510, 24.0]:
        held = _hold(held, u, 10e-3, par)
    assert held.zero == pytest.approx(10e-3, abs=1e-4)  # another one is taken at once
