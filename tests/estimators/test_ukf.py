"""The bounded unscented Kalman filter: against the Kalman filter, Monte Carlo, and what must hold for any input."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import valve_model_textbook as textbook
from c_code import driven
from c_code import run as run_in_c
from hypothesis import example, given, settings
from hypothesis import strategies as st
from table_i import defaults
from valve_model_textbook import VALVE

from gapsense.actuators import solenoid_valve
from gapsense.estimators import readings, ukf
from gapsense.estimators.kalman import Gaussian
from gapsense.estimators.valve_model import Held
from gapsense.kernels.kernel import Kernel
from gapsense.studies.devices import VALVE as SOLENOID_VALVE

KERNEL = Kernel(ukf)
FIELDS = ukf.Outputs._fields
FILTERS = {"bounded_ukf": 0.0, "unbounded_ukf": 1.0, "bounded_ekf": 2.0, "open_loop": 3.0}
ON, OFF, END, DT = 10, 510, 1010, 20e-6
ADDITIVE, AUGMENTED = 0.0, 1.0
SCALE = np.array([0.02, 1e-3, 1e-3, 0.1])


@cache
def record(volts: float = 30.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Voltage held after each sample, and the valve's outputs: 10 samples of rest, 10 ms on, 10 ms off."""
    par = SOLENOID_VALVE._replace(coil_resistance=77.5, gap_law=2.0)
    voltage = np.where((np.arange(END) >= ON) & (np.arange(END) < OFF), volts, 0.0)
    names = solenoid_valve.Outputs._fields
    return voltage, dict(zip(names, driven(solenoid_valve, par, voltage, DT, *names).T))


def run(voltage: Any, current: Any, par: Any) -> dict[str, np.ndarray]:
    """Outputs of all samples by name."""
    found = run_in_c(ukf, np.c_[voltage, current, np.zeros(len(voltage))], par)
    return dict(zip(FIELDS, found.T))


def noisy(volts: float = 30.0, size: float = 0.01, seed: int = 1) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Measurements with the noise of (37), and the filter's parameters for it."""
    voltage, truth = record(volts)
    rng = np.random.default_rng(seed)
    stds = size * voltage.mean(), size * truth["current"].mean()
    v, i = (x + s * rng.standard_normal(END) for x, s in zip((voltage, truth["current"]), stds))
    return v, i, {"noise_voltage": float(stds[0]), "noise_current": float(stds[1])}


# Against what is known ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [ADDITIVE, AUGMENTED])
@pytest.mark.parametrize("spread", [8.0, 7.5, 20.0])
def test_equals_the_kalman_filter_on_a_linear_model(noise: float, spread: float) -> None:
    """Constant reluctance, no saturation, stops far away."""
    table = {"gap_file_gap": [0.0, 1.0], "gap_file_reluctance": [3e7, 3e7], "gap_file_slope": [0.0, 0.0]}
    own = {"process_flux_linkage": 2e-6, "process_position": 1e-6}
    own |= {"process_current_error": 1e-3, "process_memory": 0.9, "process_limit": 1e9}
    far = {"core_saturation": 1e9, "stop_lower": -1e3, "stop_upper": 1e3, "noise_voltage": 0.0, "noise_current": 2e-3}
    prior = {"prior_position_std": 1e-4, "prior_flux_linkage_std": 1e-3, "prior_current_error_std": 1e-2}
    chosen = {"option_noise": noise, "option_tuning": 2.0, "sigma_spread": spread}
    par = defaults(ukf, **table, **own, **far, **prior, **chosen)
    R, T, R_m = 77.5, DT, (3e7 + 3.25e6) / 1200.0**2
    k, c, g = T**2 * 37.0 / 1.6e-3, 0.4 * T / 1.6e-3, T / (1.0 + 0.5 * T * R * R_m)
    F = np.array([[1 - g * R * R_m, 0, 0, g * R], [0, 2 - c - k, c - 1, 0], [0, 1, 0, 0], [0, 0, 0, 0.9]])
    H, Q = np.array([R_m, 0.0, 0.0, -1.0]), np.diag([4e-12, 1e-12, 0.0, 1e-6])
    state, _ = KERNEL.initial(ukf.Inputs(10.0, 0.0), par)
    x, P = np.array(state.x, float), np.array(state.P, float)
    rng = np.random.default_rng(2)
    for _ in range(150):
        measured = 0.1 + 2e-3 * rng.standard_normal()
        x, P = F @ x + [g * 10.0, k * 22.5e-3, 0.0, 0.0], F @ P @ F.T + Q
        K = P @ H / (H @ P @ H + 4e-6)
        x, P = x + K * (measured - H @ x), P - np.outer(K, H @ P)
        state, _ = KERNEL.step(state, ukf.Inputs(10.0, measured), par)
        np.testing.assert_allclose(np.array(state.x, float) / SCALE, x / SCALE, atol=1e-9)
        unit = np.outer(SCALE, SCALE)
        np.testing.assert_allclose(np.array(state.P, float) / unit, P / unit, atol=1e-9)


@pytest.mark.parametrize("noise", [ADDITIVE, AUGMENTED])
def test_prediction_has_the_moments_of_monte_carlo(noise: float) -> None:
    """In motion, away from the stops and from the kinks of the table: state and current together."""
    par = defaults(ukf, option_noise=noise)
    table = [par.gap_file_gap, par.gap_file_reluctance, par.gap_file_slope]
    x = np.array([15e-3, 0.475e-3, 0.48e-3, 5e-3])
    root = np.array([[1e-4, 0, 0, 0], [2e-6, 4e-6, 0, 0], [2e-6, 3e-6, 1e-6, 0], [1e-3, -2e-3, 1e-3, 3e-3]])
    Q = np.array(ukf._process_noise(par), float)
    before, held = Gaussian(np.array(x, object), np.array(root @ root.T, object)), Held(24.0, 0.0, 0.0)
    found, _ = ukf._predict(before, held, ukf._model(par, par.coil_resistance), par)
    rng, samples = np.random.default_rng(4), 400_000
    drawn = x[:, None] + root @ rng.standard_normal((4, samples))
    p = VALVE | {"phi": ukf.ROBUST.memory}
    moved = textbook.f(drawn, 24.0, p, table) + np.sqrt(Q)[:, None] * rng.standard_normal((4, samples))
    seen = textbook.current(moved[0], moved[1], moved[3], p, table)
    y = np.vstack([moved, seen])
    std = y.std(axis=1)
    assert np.abs((np.array(found.mean, float) - y.mean(axis=1)) / std).max() < 5.0 / math.sqrt(samples)
    cov = np.array(found.cov, float) / np.outer(std, std)
    assert np.abs(cov - np.corrcoef(y)).max() < 5.0 * math.sqrt(2.0 / samples) + 2e-3


def test_transition_is_that_of_the_textbook() -> None:
    par = defaults(ukf, option_filter=FILTERS["open_loop"])
    table = [par.gap_file_gap, par.gap_file_reluctance, par.gap_file_slope]
    voltage, _ = record()
    found = run(voltage, np.zeros(END), par)
    x = np.array([0.0, 0.9e-3, 0.9e-3, 0.0])
    for k in range(1, END):
        x = textbook.f(x, voltage[k - 1], VALVE | {"phi": ukf.ROBUST.memory}, table)
        assert found["position"][k] == pytest.approx(x[1], abs=1e-12)
        assert found["flux_linkage"][k] == pytest.approx(x[0], abs=1e-12)


def test_discretisation_follows_the_valve() -> None:
    """The open loop with exact parameters: what `paper` takes for the process noise is what is lost in a sample."""
    voltage, truth = record()
    found = run(voltage, truth["current"], defaults(ukf, option_filter=FILTERS["open_loop"]))
    assert np.abs(found["position"] - truth["position"]).max() < 12e-6
    assert np.abs(found["flux_linkage"] - truth["flux_linkage"]).max() < 60e-6


# What the filter is for -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("volts", [24.0, 30.0, 36.0])
@pytest.mark.parametrize("tuning", [0.0, 1.0])
@pytest.mark.parametrize("noise", [ADDITIVE, AUGMENTED])
def test_finds_the_position_with_exact_parameters(volts: float, tuning: float, noise: float) -> None:
    v, i, known = noisy(volts)
    found = run(v, i, defaults(ukf, option_tuning=tuning, option_noise=noise, **known))
    error = found["position"] - record(volts)[1]["position"]
    assert np.sqrt(np.mean(error**2)) < (40e-6 if tuning == 0.0 else 6e-6)
    assert np.abs(found["flux_linkage"] - record(volts)[1]["flux_linkage"]).max() < 1e-3


def worst(volts: float, tuning: float, **changes: float) -> float:
    """Mean error of the position in the last 2 ms at a stop, the larger of both."""
    v, i, known = noisy(volts)
    found = run(v, i, defaults(ukf, option_tuning=tuning, **{**known, **changes}))["position"]
    error = np.abs(found - record(volts)[1]["position"])
    return float(max(error[OFF - 100 : OFF].mean(), error[END - 100 :].mean()))


def test_parameters_of_the_own_tuning_start_from_the_robust_one() -> None:
    par = defaults(ukf)
    assert ukf.Tuning(*(getattr(par, f"process_{name}") for name in ukf.Tuning._fields)) == ukf.ROBUST


WRONG = {  # by 5 % each
    "turns": {"coil_turns": 1140.0, "core_saturation": 0.024 * 0.95 / 1.05, "spring_stiffness": 38.85},
    "core": {"core_reluctance": 3.4125e6, "core_saturation": 0.024 / 0.95, "mover_mass": 1.52e-3, "damping": 0.38},
    "warm": {"coil_resistance": 77.5 * 1.05},
    "cold": {"coil_resistance": 77.5 * 0.95},
}


@pytest.mark.parametrize("volts", [24.0, 30.0, 36.0])
@pytest.mark.parametrize("wrong", WRONG)
def test_robust_tuning_misses_no_landing_with_wrong_parameters(volts: float, wrong: str) -> None:
    assert worst(volts, 0.0, **WRONG[wrong]) < 0.1e-3


def test_tuning_of_the_paper_misses_landings() -> None:
    """N too small, k_sp and m too large by 5 %, resistance by 2 %: the robust filter lands."""
    changes = {"coil_turns": 1140.0, "core_reluctance": 3.0875e6, "core_saturation": 0.024, "coil_resistance": 79.05}
    changes |= {"spring_stiffness": 38.85, "mover_mass": 1.68e-3, "damping": 0.38}
    assert worst(24.0, 1.0, **changes) > 0.3e-3
    assert worst(24.0, 0.0, **changes) < 0.1e-3


@pytest.mark.parametrize("name", ["bounded_ukf", "bounded_ekf", "open_loop"])
def test_positions_stay_between_the_stops(name: str) -> None:
    v, i, known = noisy(size=0.1)
    found = run(v, i, defaults(ukf, option_filter=FILTERS[name], **known))
    assert found["position"].min() >= 0.0 and found["position"].max() <= 0.9e-3


def test_rests_on_the_upper_stop_without_hanging_below_it() -> None:
    """Clipping in the transition only would leave the estimate tens of micrometres short."""
    v, i, known = noisy()
    found = run(v, i, defaults(ukf, **known))
    assert np.abs(found["position"] - 0.9e-3)[END - 50 :].max() < 5e-6
    assert np.abs(found["position"] - 0.9e-3)[:ON].max() < 2e-6


def test_unbounded_filter_leaves_the_stops() -> None:
    v, i, known = noisy()
    found = run(v, i, defaults(ukf, option_filter=FILTERS["unbounded_ukf"], **known))
    assert found["position"].max() > 1e-3 or found["position"].min() < -0.1e-3
    assert all(np.all(np.isfinite(values)) for values in found.values())


@pytest.mark.parametrize(("choice", "shift"), [(0.0, 0.0), (1.0, 0.5), (2.0, 1.0)])
def test_voltage_of_the_interval(choice: float, shift: float) -> None:
    """Edges on samples, half-way, and a voltage averaged over the interval that has ended."""
    voltage, truth = record()
    ended = np.concatenate(([0.0], voltage[:-1]))  # mean over the interval that ends at the sample
    seen = {0.0: voltage, 2.0: ended}.get(choice)
    if seen is None:  # samples of which the mean is that of the interval
        seen = np.zeros(END)
        for k in range(1, END):
            seen[k] = 2.0 * ended[k] - seen[k - 1]
    par = defaults(ukf, option_filter=FILTERS["open_loop"], option_voltage=choice)
    found = run(seen, truth["current"], par)
    assert np.abs(found["flux_linkage"] - truth["flux_linkage"]).max() < 60e-6


# Whatever happens -----------------------------------------------------------------------------------------------------


def lost(kind: float, share: float = 0.1) -> tuple[np.ndarray, np.ndarray, dict[str, float], np.ndarray]:
    v, i, known = noisy()
    rng = np.random.default_rng(9)
    holes = rng.random((2, END)) < share
    holes[:, 0] = False
    return np.where(holes[0], kind, v), np.where(holes[1], kind, i), known, holes


def says(found: dict[str, np.ndarray], cause: float) -> np.ndarray:
    """Where the health names a cause."""
    return (found["health_causes"].astype(int) & int(cause)) > 0


@pytest.mark.parametrize("kind", [math.nan, math.inf, -math.inf, 1e300, -1e9])
@pytest.mark.parametrize("name", FILTERS)
def test_lost_readings_are_reported_and_recovered_from(kind: float, name: str) -> None:
    v, i, known, holes = lost(kind)
    found = run(v, i, defaults(ukf, option_filter=FILTERS[name], **known))
    assert all(np.all(np.isfinite(values)) for values in found.values())
    assert np.all(says(found, readings.LOST) == holes.any(axis=0)) and not np.any(says(found, readings.RESTARTED))
    if name != "unbounded_ukf":
        assert np.abs(found["position"] - record()[1]["position"]).max() < 0.25e-3


def test_a_long_gap_and_nothing_but_gaps() -> None:
    v, i, known = noisy()
    gap = np.arange(END)
    holes = (gap > 150) & (gap < 350)
    found = run(v, np.where(holes, math.nan, i), defaults(ukf, **known))
    assert np.abs(found["position"] - record()[1]["position"])[400:OFF].max() < 20e-6
    assert np.all(says(found, readings.LOST) == holes) and np.all(found["health"][holes] == 0.0)
    blind = run(np.full(50, math.nan), np.full(50, math.nan), defaults(ukf))
    assert all(np.all(np.isfinite(values)) for values in blind.values())
    assert np.all(blind["health_causes"] == readings.LOST)


def test_outliers_inside_the_range_are_forgotten() -> None:
    v, i, known = noisy()
    i[100], i[300] = 90.0, -90.0
    found = run(v, i, defaults(ukf, range_current=100.0, **known))
    assert found["health_causes"][100] == found["health_causes"][300] == readings.INNOVATION
    assert np.abs(found["position"] - record()[1]["position"])[OFF - 20 : OFF].max() < 20e-6
    assert found["health"][OFF - 20 : OFF].min() == 1.0


BAD = {
    "negative": np.diag([-1e-6, 1e-12, 1e-12, 1e-6]),
    "not a number": np.full((4, 4), math.nan),
    "infinite": np.diag([math.inf, 1e-12, 1e-12, 1e-6]),
    "indefinite": 1e-12 * (np.full((4, 4), 2.0) - np.eye(4)),
}


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("kind", BAD)
def test_a_lost_covariance_is_reported_and_recovered_from(kind: str, name: str) -> None:
    v, i, known = noisy()
    par = defaults(ukf, option_filter=FILTERS[name], **known)
    state, _ = KERNEL.initial(ukf.Inputs(float(v[0]), float(i[0])), par)
    state = state._replace(P=np.array(BAD[kind], object))
    seen = []
    for k in range(1, 300):
        state, outputs = KERNEL.step(state, ukf.Inputs(float(v[k]), float(i[k])), par)
        assert np.all(np.isfinite(np.array(outputs, float)))
        seen.append(outputs)
    if kind == "not a number" and name.endswith("ukf"):
        assert int(seen[0].health_causes) & int(readings.RESTARTED)
    if name == "bounded_ukf":
        assert abs(seen[-1].position - record()[1]["position"][299]) < 20e-6


def test_a_state_that_is_no_number_starts_again() -> None:
    par = defaults(ukf)
    state, _ = KERNEL.initial(ukf.Inputs(0.0, 0.0), par)
    state, outputs = KERNEL.step(state._replace(x=np.full(4, math.nan, object)), ukf.Inputs(0.0, 0.0), par)
    assert outputs.health_causes == readings.RESTARTED and outputs.health == 0.0
    assert outputs.position == pytest.approx(0.9e-3) and outputs.flux_linkage == 0.0


def test_negative_weights_lose_the_covariance_and_the_filter_goes_on() -> None:
    v, i, known = noisy()
    found = run(v, i, defaults(ukf, sigma_spread=0.01, **known))
    assert all(np.all(np.isfinite(values)) for values in found.values())


NUMBER = st.one_of(st.floats(-60.0, 60.0), st.floats(allow_nan=True, allow_infinity=True))
SAMPLE = st.tuples(NUMBER, NUMBER)
SIZE = st.sampled_from([0.0, 1e-9, 1.0, 1e6])


@settings(max_examples=80)
@given(st.lists(SAMPLE, min_size=2, max_size=30), st.sampled_from([*FILTERS]), st.integers(0, 11), SIZE)
@example([(0, 0), (0, 100), (0, 100), (18, 0), (0, 0)], "unbounded_ukf", 1, 1e6)
@example([(-15.39, -53.5), (5, 5), (39.5, math.inf), (99.9, 0)], "bounded_ekf", 4, 1e6)
def test_never_throws_and_the_covariance_stays_one(samples: Any, name: str, kind: int, size: float) -> None:
    options = {"option_noise": kind % 2, "option_tuning": kind // 2 % 2, "option_current_error": kind // 4 % 2}
    prior = {"prior_position_std": 1e-5 * size, "prior_flux_linkage_std": 1e-4 * size}
    par = defaults(ukf, option_filter=FILTERS[name], **{k: float(v) for k, v in options.items()}, **prior)
    state, _ = KERNEL.initial(ukf.Inputs(*samples[0]), par)
    for sample in samples[1:]:
        state, outputs = KERNEL.step(state, ukf.Inputs(*sample), par)
        P = np.array(state.P, float)
        np.testing.assert_array_equal(P, P.T)
        std = np.sqrt(np.diag(P))
        assert np.all(np.isfinite(P)) and np.all(np.isfinite(np.array(outputs, float)))
        correlation = P / np.outer(np.where(std > 0.0, std, 1.0), np.where(std > 0.0, std, 1.0))
        assert np.linalg.eigvalsh(correlation).min() >= -1e-6
