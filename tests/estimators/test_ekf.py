"""The extended Kalman filter on the valve model, against a textbook filter, and what must hold for any input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import reduced_model_textbook as textbook
from hypothesis import example, given, settings
from hypothesis import strategies as st
from reduced_model_textbook import TABLE_I
from table_i import QUIET, defaults
from valve_signals import Signals, exact, valve

from gapsense.estimators import ekf
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat, names

KERNEL = Kernel(ekf)


def run(s: Signals, par: Any, current: np.ndarray | None = None) -> tuple[dict[str, np.ndarray], Any]:
    """Outputs of all samples by name, and the last state."""
    iota = s.current if current is None else current
    state, rows = KERNEL.run([(*map(float, row), 0.0) for row in zip(s.voltage, iota, s.mode)], par)
    return dict(zip(names(ekf.Outputs), np.array(rows, float).T)), state


def textbook_step(
    x: np.ndarray, P: np.ndarray, held: tuple[float, int], given_: tuple[float, int], Q: np.ndarray, R: float, p: Any
) -> tuple[np.ndarray, np.ndarray]:
    """(32)-(42) as printed, the contact row left out where the position is known."""
    (v, q0), (iota, q) = held, given_
    F = textbook.F(x, q0, p)
    x, P = textbook.f(x, v, q0, p), F @ P @ F.T + Q
    H, y, noise = textbook.H(x, p)[None], np.array([iota - textbook.h(x, p)]), np.array([R])
    if q != 2 and P[0, 0] > 0.0:
        H = np.vstack([H, [1.0, 0.0, 0.0, 0.0, 0.0]])
        y, noise = np.append(y, (0.0 if q == 1 else 1.0) - x[0]), np.append(noise, 0.0)
    S = H @ P @ H.T + np.diag(noise)
    scale = np.diag(1.0 / np.sqrt(np.diag(S)))
    K = P @ H.T @ scale @ np.linalg.inv(scale @ S @ scale) @ scale
    x, P = x + K @ y, P - K @ H @ P
    bound = min(max(x[0], 0.0), 1.0)
    if bound != x[0]:  # without variance by rounding only
        x = x + (P[:, 0] / P[0, 0] if P[0, 0] > 0.0 else np.eye(5)[0]) * (bound - x[0])
    return x, P


@pytest.mark.parametrize("tau", [0.0, 0.66e-3])
def test_equals_the_textbook_filter(tau: float) -> None:
    rng = np.random.default_rng(1)
    par = defaults(ekf, process_current_error_memory=tau, range_innovation=0.0, **QUIET)
    p = {**TABLE_I, "memory": np.exp(-20e-6 / tau) if tau else 1.0}
    Q = np.diag([0.0, 0.0, 2e-6**2, 1e-3**2, 20e-6**2])
    modes = np.r_[[3] * 20, [2] * 60, [1] * 40, [2] * 30, [3] * 10]
    voltages, currents = np.where(np.arange(160) < 110, 20.0, 0.0), np.linspace(0.0, 0.35, 160)
    currents = currents + 2e-3 * rng.standard_normal(160)
    state, _ = KERNEL.initial(ekf.Inputs(voltages[0], currents[0], float(modes[0])), par)
    x, P = np.array(state.x, float), np.array(state.P, float)
    scale = np.array([1.0, 1.0, 0.02, 0.1, 1e-3])
    for k in range(1, 160):
        held = (voltages[k - 1], int(modes[k - 1]))
        x, P = textbook_step(x, P, held, (currents[k], int(modes[k])), Q, 2e-3**2, p)
        state, _ = KERNEL.step(state, ekf.Inputs(voltages[k], currents[k], float(modes[k])), par)
        np.testing.assert_allclose(np.array(state.x, float) / scale, x / scale, atol=1e-8)
        np.testing.assert_allclose(
            np.array(state.P, float) / np.outer(scale, scale), P / np.outer(scale, scale), atol=1e-8
        )


def test_equals_the_linear_kalman_filter_on_a_linear_model() -> None:
    """Without a gap reluctance that depends on the position and without saturation the model at rest is linear."""
    par = defaults(
        ekf,
        gap_slope=0.0,
        gap_reluctance=3e7,
        core_saturation=1e9,
        prior_flux_linkage_std=1e-3,
        range_innovation=0.0,
        **QUIET,
    )
    rng = np.random.default_rng(2)
    reluctance, dt, k = (3e7 + 2.52e6) / 1200.0**2, 20e-6, 20e-6**2 / 1.6e-9
    F = np.eye(5)
    F[0, :], F[1, :], F[0, 4] = 0.0, [1, 0, 0, 0, 0], k
    F[2, 2], F[2, 3], F[3, 3] = 1.0 - dt * 48.0 * reluctance, -dt * 48.0, np.exp(-dt / 0.66e-3)
    H = np.array([[0.0, 0.0, reluctance, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]])
    Q, R = np.diag([0.0, 0.0, 2e-6**2, 1e-3**2, 20e-6**2]), np.diag([2e-3**2, 0.0])
    offset = np.array([1.0 + k * 6.18e-5 * 17.8, 0.0, dt * 10.0, 0.0, 0.0])
    state, _ = KERNEL.initial(ekf.Inputs(10.0, 0.0, 3.0), par)
    x, P = np.array(state.x, float), np.array(state.P, float)
    for _ in range(100):
        iota = 0.1 + 2e-3 * rng.standard_normal()
        x, P = F @ x + offset, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.pinv(H @ P @ H.T + R, rcond=1e-30)  # at first the position is known
        x, P = x + K @ (np.array([iota, 1.0]) - H @ x), P - K @ H @ P
        state, _ = KERNEL.step(state, ekf.Inputs(10.0, iota, 3.0), par)
        np.testing.assert_allclose(np.array(state.x, float), x, atol=1e-11)
        np.testing.assert_allclose(np.array(state.P, float), P, atol=1e-13)


def test_position_in_contact_is_exact_and_without_variance() -> None:
    found, _ = run(valve(), exact())
    for mode, stop in ((1.0, 1e-4), (3.0, 0.9e-3)):
        rests = valve().mode == mode
        assert rests.sum() > 50
        np.testing.assert_allclose(found["position"][rests], stop, rtol=1e-15)
        assert np.all(found["position_std"][rests] == 0.0)


@pytest.mark.parametrize("force_error", [1.0, 0.0])
@pytest.mark.parametrize("current_error", [1.0, 0.0])
def test_follows_the_motion_with_the_right_parameters(force_error: float, current_error: float) -> None:
    s = valve()
    found, state = run(s, exact(option_force_error=force_error, option_current_error=current_error))
    error = np.abs(found["position"] - s.position)
    assert error.max() < 0.09e-3, error.max()  # the stroke is 0.8 mm
    assert np.abs(found["flux_linkage"] - s.flux_linkage).max() < 5e-4
    if not current_error:
        assert np.all(found["current_error"] == 0.0) and state.P[3, 3] == 0.0
    if not force_error:
        assert np.all(found["force_error"] == 0.0) and state.P[4, 4] == 0.0


def test_health_falls_with_a_wrong_resistance_and_not_with_the_right_one() -> None:
    noise = 2e-3 * np.random.default_rng(3).standard_normal(valve().current.size)
    found, _ = run(valve(), exact(), valve().current + noise)
    assert found["health"].min() == 1.0
    quiet = {"process_current_error": 1e-5, "process_flux_linkage": 1e-7}
    wrong, _ = run(valve(), exact(**quiet, coil_resistance=110.0), valve().current + noise)
    assert wrong["health"].mean() < 0.9


ANY = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e3])
NUMBER = st.tuples(
    st.one_of(st.floats(-50.0, 50.0), ANY),
    st.one_of(st.floats(-1.0, 1.0), ANY),
    st.one_of(st.sampled_from([1.0, 2.0, 3.0]), ANY),
)


NOTHING = [(1.884126663743103e-36, 0.0, 2.0), *[(0.0, 0.0, 2.0)] * 4]  # a projection moved the flux linkage to 2e36 Wb


@settings(max_examples=40)
@given(st.lists(NUMBER, min_size=2, max_size=40), st.booleans(), st.booleans())
@example(NOTHING, False, False)
def test_covariance_stays_symmetric_and_non_negative(samples: Any, has_force: bool, has_current: bool) -> None:
    par = defaults(ekf, option_force_error=float(has_force), option_current_error=float(has_current))
    state, _ = KERNEL.initial(ekf.Inputs(*samples[0]), par)
    unit = np.array([1.0, 1.0, 0.02, 0.1, 1e-3])
    for sample in samples[1:]:
        state, outputs = KERNEL.step(state, ekf.Inputs(*sample), par)
        P = np.array(state.P, float) / np.outer(unit, unit)
        np.testing.assert_array_equal(P, P.T)
        assert np.all(np.diag(P) >= 0.0)
        assert np.linalg.eigvalsh(P).min() >= -1e-9 * max(1.0, np.abs(P).max())
        assert np.all(np.isfinite(np.array(flat(outputs), float)))
        assert 0.4e-3 <= outputs.estimates.position <= 1.4e-3 + 1e-18
