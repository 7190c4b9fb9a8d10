"""The reduced model against the paper's formulas, its Jacobians against complex steps and against those by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import reduced_model_textbook as textbook
from reduced_model_textbook import TABLE_I
from scipy.interpolate import CubicSpline
from table_i import defaults

from gapsense.estimators import ekf
from gapsense.estimators.reduced_model import (
    Held,
    Model,
    acceleration,
    gap_law,
    magnetic_force,
    normalise_model,
    observation,
    rest,
    transition,
)
from gapsense.kernels.derivative import linearise

MODEL = normalise_model(defaults(ekf, process_current_error_memory=0.0))
STATES = [
    [1.0, 1.0, 0.0, 0.0, -1e-3],
    [0.4, 0.43, 0.015, 0.02, 1e-4],
    [0.02, 0.0, 0.0231, -0.03, 2e-4],  # above 95 % of saturation
    [-0.1, 0.05, -0.012, 0.0, 0.0],
    [1.2, 1.1, -0.0235, 0.0, -5e-4],
]


def complex_step(function: Any, x: list[float]) -> np.ndarray:
    columns = []
    for k in range(len(x)):
        moved = np.array(x, complex)
        moved[k] += 1e-30j
        columns.append(np.imag(np.atleast_1d(function(moved))) / 1e-30)
    return np.array(columns).T


def close(found: Any, expected: Any) -> None:
    scale = np.maximum(np.abs(expected), 1e-12 * np.abs(expected).max())
    assert np.all(np.abs(np.array(found, float) - expected) <= 1e-12 * np.maximum(scale, 1.0)), (found, expected)


def test_normalised_parameters_are_those_of_table_ii() -> None:
    for name in ("m", "k_sp", "z_sp", "c_f", "R_c0", "lam_sat"):
        assert getattr(MODEL, name) == pytest.approx(TABLE_I[name], rel=1e-12), name


def table_law(low: float = 0.2e-3, high: float = 1.6e-3) -> tuple[Model, dict[str, Any]]:
    """Model with twelve rows of another gap law from `low` to `high`, and the same for the textbook."""
    gaps = np.linspace(low, high, 12)
    reluctances = 3e6 + 4.5e10 * gaps - 0.9e13 * gaps**2 + 5e4 * np.sin(7e3 * gaps)
    curvatures = CubicSpline(gaps, reluctances)(gaps, 2)
    tables = {"gap_knots": gaps, "gap_reluctance": reluctances, "gap_curvature": curvatures}
    model = MODEL._replace(gap_is_table=True, **{name: tuple(t.tolist()) for name, t in tables.items()})
    return model, {**TABLE_I, "table": (gaps, reluctances)}


@pytest.mark.parametrize("x", STATES)
@pytest.mark.parametrize("ends", [(0.2e-3, 1.6e-3), (0.5e-3, 1.1e-3)])  # beyond the second the estimates lie outside
def test_gap_table_and_its_jacobians(x: list[float], ends: tuple[float, float]) -> None:
    model, p = table_law(*ends)
    for q in (1, 2, 3):
        found, F = linearise(transition, x, Held(20.0, float(q)), model)
        close(found, textbook.f(x, 20.0, q, p))
        close(F, complex_step(lambda y, q=q: textbook.f(y, 20.0, q, p), x))
        if x[2] != 0.0:
            close(F, textbook.F(x, q, p))
    found, H = linearise(observation, x, model)
    close(found, np.atleast_1d(textbook.h(x, p)))
    close(H, complex_step(lambda y: textbook.h(y, p), x))


def test_gap_table_is_twice_differentiable_everywhere() -> None:
    model, p = table_law(0.5e-3, 1.1e-3)
    for g in (*p["table"][0], 0.2e-3, 2e-3):
        z = (g - model.z_min) / model.l_z
        (R, slope), (R_next, slope_next) = gap_law(z - 1e-7, model), gap_law(z + 1e-7, model)
        assert R_next - R == pytest.approx(2e-7 * textbook.gap(z, p)[1], rel=1e-6)
        assert slope_next - slope == pytest.approx(2e-7 * textbook.gap(z, p)[2], rel=1e-4)


def test_table_of_the_formula_is_the_formula() -> None:
    par = defaults(ekf, gap_law=1.0)
    table, formula = normalise_model(par), normalise_model(par._replace(gap_law=0.0))
    for z in np.linspace(-0.1, 1.1, 25):
        assert gap_law(z, table) == pytest.approx(gap_law(z, formula), rel=3e-4)
    assert hash(table) == hash(normalise_model(par))


@pytest.mark.parametrize("x", STATES)
@pytest.mark.parametrize("q", [1, 2, 3])
@pytest.mark.parametrize("memory", [1.0, 0.97])
def test_transition_and_its_jacobian(x: list[float], q: int, memory: float) -> None:
    p = {**TABLE_I, "memory": memory}
    found, F = linearise(transition, x, Held(20.0, float(q)), MODEL._replace(memory=memory))
    close(found, textbook.f(x, 20.0, q, p))
    close(F, complex_step(lambda y: textbook.f(y, 20.0, q, p), x))
    if x[2] != 0.0:
        close(F, textbook.F(x, q, p))


def test_memory_is_a_time_constant_and_zero_stands_for_the_paper() -> None:
    def memory(**changes: float) -> float:
        return float(normalise_model(defaults(ekf, **changes)).memory)

    assert memory() == pytest.approx(np.exp(-20.0 / 660.0), rel=1e-15)
    assert memory(sample_time=5e-6) ** 4 == pytest.approx(memory(), rel=1e-14)
    assert memory(process_current_error_memory=0.0) == 1.0


@pytest.mark.parametrize("x", STATES)
def test_observation_and_its_jacobian(x: list[float]) -> None:
    found, H = linearise(observation, x, MODEL)
    close(found, np.atleast_1d(textbook.h(x, TABLE_I)))
    close(H, complex_step(lambda y: textbook.h(y, TABLE_I), x))
    close(H[0], textbook.H(x, TABLE_I))


def test_without_force_error_the_stop_holds_the_mover() -> None:
    model = MODEL._replace(has_force_error=0.0)
    for q, z in ((1.0, 0.0), (3.0, 1.0)):
        found, F = linearise(transition, [0.3, 0.3, 0.01, 0.0, 0.0], Held(10.0, q), model)
        assert found[0] == z and np.all(F[0] == 0.0)
        assert rest(q, 0.01, model)[4] == 0.0


@pytest.mark.parametrize(("mode", "lam"), [(1.0, 0.02), (3.0, 0.0), (3.0, 0.005)])
def test_force_error_holds_the_mover_at_rest(mode: float, lam: float) -> None:
    z, z_prev, _, e_i, e_F = rest(mode, lam, MODEL)
    assert z == z_prev == (0.0 if mode == 1.0 else 1.0) and e_i == 0.0
    force = magnetic_force(gap_law(z, MODEL)[1], lam) + e_F
    assert abs(acceleration(z, 0.0, force, MODEL)) < 1e-9 * MODEL.k_sp * MODEL.z_sp / MODEL.m
    if lam == 0.0:
        assert e_F == pytest.approx(-TABLE_I["k_sp"] * (TABLE_I["z_sp"] - 1.0), rel=1e-12)  # (61)


def test_gap_law_goes_on_smoothly_beyond_its_ends() -> None:
    """Its value and its slope are continuous, also below a closed gap and above the fringing length."""
    for g in (1e-6, MODEL.gap_window):
        z = (g - MODEL.z_min) / MODEL.l_z
        (R, slope), (R_next, slope_next) = gap_law(z - 1e-9, MODEL), gap_law(z + 1e-9, MODEL)
        assert R_next - R == pytest.approx(2e-9 * slope, rel=1e-3) and slope_next == pytest.approx(slope, rel=1e-4)
    for z in (-1e6, -0.4, 1e6):
        assert np.all(np.isfinite(gap_law(z, MODEL)))


def test_tilt_adds_a_slope_around_the_middle() -> None:
    tilted = MODEL._replace(gap_tilt=0.1 * gap_law(0.5, MODEL)[1])
    for z in (0.0, 0.5, 1.0):
        (R, slope), (R_tilted, slope_tilted) = gap_law(z, MODEL), gap_law(z, tilted)
        assert R_tilted - R == pytest.approx((z - 0.5) * tilted.gap_tilt, abs=1e-12)
        assert slope_tilted - slope == pytest.approx(tilted.gap_tilt, rel=1e-9)
    assert isinstance(tilted, Model)
