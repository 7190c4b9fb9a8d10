"""The hybrid Kalman filter: Jacobians, the linear filter, every transition, and what must hold for any input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from c_code import run as run_in_c
from hypothesis import given, settings
from hypothesis import strategies as st
from magnet_signals import PLANTS, PULSES, T_S, changes_of, exact, faulty, magnet
from magnets import POT_MAGNET

from gapsense.estimators import hybrid_ekf
from gapsense.estimators.hybrid_ekf import Held, Inputs, extrapolate, model, moving, resting
from gapsense.kernels.derivative import linearise
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names
from gapsense.kernels.linalg import vector

KERNEL = Kernel(hybrid_ekf)
both = pytest.mark.parametrize("orientation", sorted(PLANTS))


def run(voltage: np.ndarray, current: np.ndarray, par: Any) -> dict[str, np.ndarray]:
    """Outputs of all samples by name."""
    _, rows = KERNEL.run(zip(voltage.tolist(), current.tolist()), par)
    return dict(zip(hybrid_ekf.Outputs._fields, np.array(rows, float).T))


def noisy(current: np.ndarray, sigma: float, seed: int = 1) -> np.ndarray:
    return current + sigma * np.random.default_rng(seed).standard_normal(current.size)


def complex_step(function: Any, x: list[float], held: Held, mod: Any) -> np.ndarray:
    """Jacobian of `function` at `x` by complex steps."""
    columns = []
    for k in range(len(x)):
        point = vector([complex(value, 1e-30 if j == k else 0.0) for j, value in enumerate(x)])
        columns.append([value.imag / 1e-30 for value in function(point, held, mod)])
    return np.array(columns).T


@both
@pytest.mark.parametrize("mode", range(5))
@pytest.mark.parametrize("seed", range(3))
def test_jacobian_of_each_mode_equals_complex_step(orientation: str, mode: int, seed: int) -> None:
    rng = np.random.default_rng([seed, mode])
    mod = model(exact(orientation))
    i, s, v = 0.2 * rng.standard_normal(), mod.s_max * rng.random(), 0.1 * rng.standard_normal()
    R = mod.K7 if mode >= 3 else mod.K6
    if mode in (1, 4):
        function, x, held = extrapolate, [i, s, v], Held(24.0, R, 0.0, T_S)
    else:
        function, x, held = resting, [i], Held(24.0, R, 0.0 if mode == 0 else mod.s_max, T_S)
    values, F = linearise(function, vector(x), held, mod)
    expected = complex_step(function, x, held, mod)
    np.testing.assert_array_equal(np.array(values, float), np.array(function(vector(x), held, mod), float))
    np.testing.assert_allclose(np.array(F, float), expected, rtol=1e-12, atol=1e-12 * np.abs(expected).min())


def flown(x: Any, mod: Any, duration: float, count: int) -> Any:
    """(i, s, v) after so many steps in the air."""
    i, s, v = x
    y = vector([i / (mod.path + mod.slope * s), s, v])
    for _ in range(count):
        y = moving(y, Held(24.0, mod.K6, 0.0, duration / count), mod)
    return vector([y[0] * (mod.path + mod.slope * y[1]), *y[1:]])


@both
def test_motion_has_order_two(orientation: str) -> None:
    """Against steps a hundred times as fine, in the states of the printed equations."""
    mod = model(exact(orientation))
    start = vector([0.15, 0.3 * mod.s_max, 0.02])
    exact_end = np.array(flown(start, mod, 1e-3, 4000), float)
    errors = [np.abs(np.array(flown(start, mod, 1e-3, n), float) / exact_end - 1.0).max() for n in (10, 20, 40)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.25)


@both
def test_jacobian_of_motion_is_right_to_first_order(orientation: str) -> None:
    """Against that of fine steps, each state in its unit: what one step leaves out is of the second order."""
    mod = model(exact(orientation))
    start, unit = [0.15, 0.3 * mod.s_max, 0.02], np.array([0.1, 1e-4, 0.1])
    errors = []
    for dt in (4e-5, 2e-5, 1e-5):
        held = Held(24.0, mod.K6, 0.0, dt)
        fine = complex_step(lambda x, held, mod: flown(x, mod, held.dt, 50), start, held, mod)
        coarse = np.array(linearise(extrapolate, vector(start), held, mod)[1], float)
        errors.append(np.abs((coarse - fine) * unit / unit[:, None]).max())
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.25)


@both
@pytest.mark.parametrize("method", [extrapolate, lambda x, held, mod: flown(x, mod, held.dt, 1)], ids=["F", "x"])
def test_small_steps_solve_the_printed_equations(method: Any, orientation: str) -> None:
    """(17) written out, with the motional term, against the difference quotient of a tiny step."""
    p = PLANTS[orientation]
    mod, (i, s, v), dt = model(exact(orientation)), (0.15, 0.3 * p.stop_upper, 0.05), 1e-9
    sign = -1.0 if orientation == "printed" else 1.0
    path = p.core_length + 2.0 * p.core_permeability * (s if sign < 0.0 else p.stop_upper - s)
    K5 = p.coil_turns**2 * p.core_permeability * 1.257e-6 * p.pole_area
    L, slope = K5 / path, sign * 2.0 * p.core_permeability * K5 / path**2
    expected = [(24.0 - (mod.K6 + slope * v) * i) / L, v, 0.5 * i**2 * abs(slope) / p.mover_mass - 9.81]
    found = (np.array(method(vector([i, s, v]), Held(24.0, mod.K6, 0.0, dt), mod), float) - [i, s, v]) / dt
    np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize("mode", [0, 2, 3])
def test_equals_the_linear_kalman_filter_in_a_fixed_mode(mode: int) -> None:
    par = exact(
        prior_current=0.05, prior_position=0.0 if mode == 0 else 0.2e-3, current_off=0.02 if mode == 2 else 1e-6
    )
    mod, sigma, q = model(par), par.noise_current, par.process_current
    u = {0: 8.0, 2: 24.0, 3: 1e-5}[mode]  # too little to lift; enough to sustain; too little for that
    R, s = (mod.K6, 0.0) if mode == 0 else (mod.K6 if mode == 2 else mod.K7, mod.s_max)
    decay = math.exp(-R / mod.K5 * (mod.path + mod.slope * s) * T_S)
    rng = np.random.default_rng(3)
    measured = 0.05 + sigma * rng.standard_normal(200)
    found = run(np.full(200, u), measured, par)
    assert set(found["mode"][1:]) == {float(mode)}
    x, P = 0.05, par.prior_current_std**2
    for k in range(1, 200):
        x, P = decay * x + (1.0 - decay) * u / R, decay**2 * P + q**2
        K = P / (P + sigma**2)
        x, P = x + K * (measured[k] - x), (1.0 - K) * P
        assert found["current_estimated"][k] == pytest.approx(x, abs=1e-10)
        assert found["current_std"][k] == pytest.approx(math.sqrt(P), rel=1e-7)
    assert np.all(found["position"] == s) and np.all(found["position_std"] == 0.0)


def test_equals_the_textbook_filter_in_the_air() -> None:
    par = exact(sub_steps=1.0)
    mod = model(par)
    Q = np.diag([par.process_current_moving, par.process_position, par.process_velocity]) ** 2
    x, P = np.array([0.12, 0.05e-3, 0.03]), np.diag([1e-3, 1e-6, 1e-3]) ** 2
    state, _ = KERNEL.initial(Inputs(24.0, 0.0), par)
    state = state._replace(x=vector(x.tolist()), P=np.array(P, dtype=object), mode=1.0)
    scale = np.array([0.1, 1e-4, 0.1])
    for measured in (0.118, 0.119, 0.117, 0.115, 0.117):
        held = Held(24.0, mod.K6, 0.0, T_S)
        F = complex_step(extrapolate, x.tolist(), held, mod)
        x, P = np.array(flown(x.tolist(), mod, T_S, 1), float), F @ P @ F.T + Q
        K = P[:, 0] / (P[0, 0] + par.noise_current**2)
        x, P = x + K * (measured - x[0]), P - np.outer(K, P[0])
        state, outputs = KERNEL.step(state, Inputs(24.0, measured), par)
        assert outputs.mode == 1.0
        np.testing.assert_allclose(np.array(state.x, float) / scale, x / scale, atol=1e-10)
        np.testing.assert_allclose(np.array(state.P, float) / np.outer(scale, scale), P / np.outer(scale, scale), 1e-9)


@pytest.mark.parametrize("tuning", [0.0, 2.0], ids=["robust", "open loop"])
@pytest.mark.parametrize("pulses", PULSES)
def test_takes_every_transition_of_the_plant(pulses: str, tuning: float) -> None:
    s = magnet(pulses)
    expected = PULSES[pulses][1]
    in_samples = [*expected[:-2], (4, 2)] if pulses == "pulled back" else expected  # 4 -> 3 -> 2 within a sample
    assert changes_of(s.states[:, 3]) == in_samples
    found = run(s.voltage, noisy(s.states[:, 0], 1e-4), exact(tuning=tuning, noise_current=1e-4, landing_band=0.0))
    assert changes_of(found["mode"]) == expected
    assert np.mean(found["mode"] != s.states[:, 3]) < 0.01
    assert np.abs(found["position"] - s.states[:, 1]).max() < 2e-6


def test_all_transitions_are_exercised() -> None:
    taken = {change for _, changes in PULSES.values() for change in changes}
    assert taken == {(0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (1, 0), (4, 1), (3, 2), (4, 3)}


def test_pulled_back_below_i_on_lands_in_mode_3() -> None:
    """4 -> 3 without the voltage that makes it 2 at once."""
    par = exact(landing_band=0.0)
    state, _ = KERNEL.initial(Inputs(0.0, 0.0), par)
    x = vector([0.05, 0.2e-3 - 1e-7, 0.05])
    state, outputs = KERNEL.step(state._replace(x=x, mode=4.0), Inputs(0.0, math.nan), par)
    assert (outputs.mode, outputs.position, outputs.velocity) == (3.0, 0.2e-3, 0.0)


@both
@pytest.mark.parametrize("sigma", [1e-3, 1e-2, 1e-1])
def test_noise_does_not_make_the_mode_chatter(orientation: str, sigma: float) -> None:
    s = magnet("cycle", orientation)
    for seed in range(5):
        found = run(s.voltage, noisy(s.states[:, 0], sigma, seed), exact(orientation, noise_current=sigma))
        assert changes_of(found["mode"]) == PULSES["cycle"][1]
        assert np.mean(found["mode"] != s.states[:, 3]) < 0.02


def test_published_tuning_passes_the_current_through() -> None:
    s = magnet()
    noise = noisy(0.0 * s.states[:, 0], 1e-3)
    found = run(s.voltage, s.states[:, 0] + noise, exact(tuning=1.0))
    passed = (found["current_estimated"] - s.states[:, 0])[5:] / noise[5:]
    assert np.median(passed) == pytest.approx(0.99, abs=1e-3)
    loud = [run(s.voltage, noisy(s.states[:, 0], 0.1), exact(tuning=t, noise_current=0.1)) for t in (0.0, 1.0)]
    wrong = [np.mean(found["mode"] != s.states[:, 3]) for found in loud]
    assert wrong[0] < 0.02 < 0.3 < wrong[1]


@both
def test_corrects_wrong_parameters(orientation: str) -> None:
    s = magnet("cycle", orientation)
    p = PLANTS[orientation]
    wrong = {"coil_resistance": 1.05 * p.coil_resistance, "pole_area": 0.97 * p.pole_area, "noise_current": 1e-3}
    errors = []
    for tuning in (0.0, 2.0):
        found = run(s.voltage, noisy(s.states[:, 0], 1e-3), exact(orientation, tuning=tuning, **wrong))
        errors.append(
            [
                np.sqrt(np.mean((found[name] - s.states[:, k]) ** 2))
                for k, name in ((0, "current_estimated"), (1, "position"))
            ]
        )
    assert errors[0][0] < 0.5 * errors[1][0] and errors[0][1] < 0.9 * errors[1][1]


WRONG: dict[str, tuple[dict[str, float], bool]] = {  # from the start; and whether more than 25 um come of it
    "resistance": ({"coil_resistance": 180.0, "coil_resistance_upper": 190.0}, True),
    "stop": ({"stop_upper": 0.4e-3}, True),
    "resistance that is corrected": ({"coil_resistance": 90.0}, False),
    "nothing": ({}, False),
}


@pytest.mark.parametrize("told", WRONG)
def test_health_says_when_the_model_is_so_wrong_that_the_estimate_is(told: str) -> None:
    changes, is_wrong = WRONG[told]
    s = magnet()
    found = run(s.voltage, noisy(s.states[:, 0], 1e-3), exact(**changes))
    assert (np.mean(np.abs(found["position"] - s.states[:, 1]) > 25e-6) > 0.2) == is_wrong
    assert found["health"].mean() < 0.8 if is_wrong else found["health"].min() == 1.0


HALF, FIRST, LAST, HALVES = 600, 24, 30, 34  # samples of an operation; those with a fault
CLOSED = 2.0 * POT_MAGNET.core_permeability * POT_MAGNET.stop_upper  # what a gap is in length of the field lines
FAULTS: dict[str, tuple[dict[str, float], float]] = {  # what changes, and by how much the lower stop moves
    "lower stop 30 % higher": ({"stop_upper": 0.7 * POT_MAGNET.stop_upper}, 0.3 * POT_MAGNET.stop_upper),
    "stuck at the upper stop": ({"stop_upper": 1e-9}, POT_MAGNET.stop_upper),
    "stuck at the lower stop": ({"stop_upper": 1e-9, "core_length": POT_MAGNET.core_length + CLOSED}, 0.0),
    "weight 40 % less": ({"gravity": 0.6 * POT_MAGNET.gravity}, 0.0),
}


@pytest.mark.parametrize("tuning", [0.0, 1.0], ids=["robust", "paper"])
@pytest.mark.parametrize("fault", [*FAULTS, None])
def test_health_tells_faults_and_nothing_else(fault: str | None, tuning: float) -> None:
    """A mover stuck above had 1 in 20 % of the wrong time, less weight in all of it; the paper's tuning always."""
    changes, offset = FAULTS[fault] if fault else ({}, 0.0)
    s = faulty(FIRST, LAST, HALVES, HALF, **changes)
    faults = slice(FIRST * HALF, LAST * HALF)
    position = s.states[:, 1].copy()
    position[faults] += offset
    found = run_in_c(hybrid_ekf, np.c_[s.voltage, noisy(s.states[:, 0], 1e-3)], exact(tuning=tuning))
    found = dict(zip(names(hybrid_ekf.Outputs), found.T))
    health, wrong = found["health"], np.abs(found["position"] - position) > 25e-6
    assert np.all(health[: faults.start] == 1.0) and np.all(health[-HALF:] == 1.0)
    if fault is None:
        assert np.all(health == 1.0)
    else:
        assert wrong[faults].sum() > 100
        assert (wrong & (health == 1.0))[faults].sum() <= 0.05 * wrong[faults].sum()


@pytest.mark.parametrize("lost", [math.nan, math.inf, -math.inf, 1e300])
def test_lost_measurements_are_predicted_over_and_recovered_from(lost: float) -> None:
    s = magnet()
    measured, voltage = noisy(s.states[:, 0], 1e-3), s.voltage.copy()
    gap = slice(100, 140)
    measured[gap], voltage[120:130] = lost, lost
    found = run(voltage, measured, exact())
    assert np.all(np.isfinite(np.array([*found.values()])))
    assert np.all(found["health"][gap] == 0.0) and np.all(found["innovation"][gap] == 0.0)
    assert found["health"][200:].min() == 1.0
    assert np.all(np.diff(found["current_std"][gap]) > 0.0)
    assert changes_of(found["mode"]) == PULSES["cycle"][1]


NUMBERS = st.one_of(st.floats(-2.0, 2.0), st.floats(allow_nan=True, allow_infinity=True))
VOLTAGES = st.one_of(st.sampled_from([0.0, 24.0, -24.0]), st.floats(-100.0, 100.0), st.just(math.nan))


@settings(max_examples=100)
@given(
    st.lists(st.tuples(VOLTAGES, NUMBERS), min_size=2, max_size=60), st.integers(0, 2), st.booleans(), st.integers(1, 9)
)
def test_covariance_stays_symmetric_and_non_negative(samples: Any, tuning: int, printed: bool, every: int) -> None:
    par = exact("printed" if printed else "consistent", tuning=float(tuning))
    state, outputs = KERNEL.initial(Inputs(*samples[0]), par)
    for k in range(every * len(samples)):
        state, outputs = KERNEL.step(state, Inputs(*samples[k // every]), par)
        assert np.all(np.isfinite(np.array(outputs, float)))
        assert 0.0 <= outputs.position <= par.stop_upper and outputs.mode in (0.0, 1.0, 2.0, 3.0, 4.0)
        P = np.array(state.P, float)
        np.testing.assert_array_equal(P, P.T)
        unit = np.sqrt(np.where(np.diag(P) > 0.0, np.diag(P), 1.0))
        assert np.linalg.eigvalsh(P / np.outer(unit, unit)).min() >= -1e-9
        if outputs.mode in (0.0, 2.0, 3.0):
            assert P[1, 1] == P[2, 2] == outputs.velocity == 0.0
