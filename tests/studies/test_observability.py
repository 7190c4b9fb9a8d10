"""Observability of SEMERA's model, [SEMERA] Section II-B."""

from __future__ import annotations

import time
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.scenarios.semera_valve.observability import (
    flux_state_matrix,
    observability_matrix,
    rank,
    steps_since_observable,
)

DT = 50e-6
F = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [0.0, 1.0, 0.0]])


def exact_rank(matrix: Any) -> int:
    """Rank by elimination in fractions."""
    rows, found = [list(row) for row in matrix], 0
    for column in range(len(rows[0])):
        pivot = next((r for r in rows[found:] if r[column] != 0), None)
        if pivot is None:
            continue
        rows.remove(pivot)
        rows.insert(found, pivot)
        for k in range(found + 1, len(rows)):
            factor = rows[k][column] / pivot[column]
            rows[k] = [a - factor * b for a, b in zip(rows[k], pivot)]
        found += 1
    return found


def fractions(values: Any) -> np.ndarray:
    return np.array([Fraction(v) for v in values], dtype=object)


def determinant(current: Any, dt: Any) -> Any:
    """Determinant of the matrices for n = 2, as the polynomial (32) [A^3/s^2]; array (m - 3,)."""
    before, i0, i1, i2 = current[:-3], current[1:-2], current[2:-1], current[3:]
    squares = 2 * before * i1 * i1 + 2 * i0 * i0 * i2
    mixed = i0 * i0 * i1 + i0 * i1 * i1 + before * i0 * i2 + before * i1 * i2
    return (squares - mixed) / (dt * dt)


def exponential(count: int, tau: float = 0.7e-3) -> np.ndarray:
    return 0.4 * (1.0 - np.exp(-np.arange(count) * DT / tau))


@pytest.mark.parametrize("n", [2, 3, 7])
def test_matrix_is_C_times_powers_of_F(n: int) -> None:
    i = np.random.default_rng(1).normal(size=12)
    found = observability_matrix(i, DT, n)
    assert found.shape == (12 - n - 1, n + 1, 3)
    for w, matrix in enumerate(found):
        for j in range(n + 1):
            k = w + 1 + j
            C = np.array([i[k], i[k] / DT, -i[k - 1] / DT])
            np.testing.assert_allclose(matrix[j], C @ np.linalg.matrix_power(F, j), rtol=1e-12, atol=1e-10 / DT)


@settings(max_examples=40)
@given(st.lists(st.fractions(-5, 5, max_denominator=20), min_size=4, max_size=4))
def test_determinant_is_that_of_the_matrix_exactly(i: list[Fraction]) -> None:
    dt = Fraction(1, 20000)
    (a, b, c), (d, e, f), (g, h, k) = observability_matrix(fractions(i), dt)[0]
    assert determinant(fractions(i), dt)[0] == a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g)


@settings(max_examples=40)
@given(st.fractions(-5, 5), st.fractions(-2, 2), st.integers(2, 9))
def test_linear_current_has_rank_two_at_most_exactly(start: Fraction, slope: Fraction, n: int) -> None:
    i = fractions(start + k * slope for k in range(n + 2))
    matrix = observability_matrix(i, Fraction(1, 20000), n)[0]
    for j in range(2, n + 1):  # (35)
        assert list(matrix[j]) == [2 * a - b for a, b in zip(matrix[j - 1], matrix[j - 2])]
    assert exact_rank(matrix) == (2 if slope else 1 if start else 0)
    if n == 2:
        assert determinant(i, Fraction(1, 20000))[0] == 0


def test_linear_current_has_rank_two_in_floats_with_the_tolerance() -> None:
    i = 0.3 + 0.007 * np.arange(50)
    assert set(rank(observability_matrix(i, DT, 2), DT)) == {2}
    assert set(rank(observability_matrix(i, DT, 12), DT)) == {2}


def test_exponential_current_is_observable_and_a_parabola_too() -> None:
    assert set(rank(observability_matrix(exponential(20), DT), DT)) == {3}
    i = fractions(k * k for k in range(5))
    assert exact_rank(observability_matrix(i, Fraction(1, 20000))[1]) == 3


@settings(max_examples=40)
@given(st.lists(st.fractions(-5, 5, max_denominator=50), min_size=4, max_size=10))
def test_flux_state_never_has_rank_three_exactly(i: list[Fraction]) -> None:
    matrix = flux_state_matrix(fractions(i), Fraction(1, 20000), len(i) - 2)[0]
    assert exact_rank(matrix) == (2 if len(set(i[1:])) > 1 else 1)


def test_flux_state_has_rank_two_in_floats() -> None:
    assert set(rank(flux_state_matrix(exponential(30), DT, 4), DT)) == {2}


def test_rank_does_not_depend_on_units() -> None:
    i = exponential(30)
    for ampere, second in ((1.0, 1.0), (1e3, 1.0), (1e-6, 1e6)):
        matrices = observability_matrix(i * ampere, DT * second)
        assert set(rank(matrices, DT * second)) == {3}


def steps_by_definition(i: np.ndarray, tolerance: float) -> np.ndarray:
    found = np.full(i.size, np.nan)
    for k in range(3, i.size):
        for n in range(2, k):
            windows = [observability_matrix(i[k - n - 1 : k - n + m + 1], DT, m)[0] for m in range(2, n + 1)]
            if any(rank(window, DT, tolerance) == 3 for window in windows):
                found[k] = n
                break
    return found


def test_steps_since_observable_equals_its_definition() -> None:
    i = np.concatenate((np.zeros(6), exponential(25), np.full(12, 0.33), 0.33 - 0.01 * np.arange(12), exponential(8)))
    for tolerance in (1e-3, 1e-6, 1e-9):
        np.testing.assert_array_equal(steps_since_observable(i, DT, tolerance), steps_by_definition(i, tolerance))


def test_square_wave_is_observable_in_minimum_time_except_in_steady_state() -> None:
    phase = np.arange(1600) % 400
    up, down = 1.0 - np.exp(-phase * DT / 0.7e-3), np.exp(-(phase - 200) * DT / 0.7e-3)
    begin = time.perf_counter()
    steps = steps_since_observable(0.4 * np.where(phase < 200, up, down), DT)
    assert time.perf_counter() - begin < 5.0
    assert np.all(np.isnan(steps[:3])) and np.nanmin(steps) == 2.0
    transient = (phase % 200 > 3) & (phase % 200 < 60)
    assert np.all(steps[transient & (phase < 200)] == 2.0)
    steady = phase >= 204
    np.testing.assert_array_equal(np.diff(steps)[steady[1:] & steady[:-1]], 1.0)  # the decay is never observable
    assert np.all(
        steps_since_observable(0.4 * np.where(phase < 200, up, down), DT, 1e-6)[(phase > 150) & (phase < 200)] > 2
    )


def test_decay_to_zero_has_rank_two_exactly() -> None:
    matrix = observability_matrix(fractions(Fraction(4, 5) ** k for k in range(9)), Fraction(1, 20000), 7)[0]
    assert exact_rank(matrix) == 2


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_too_few_samples_are_never_observable(count: int) -> None:
    assert np.all(np.isnan(steps_since_observable(exponential(count), DT)))


def test_constant_and_zero_current_are_never_observable() -> None:
    assert np.all(np.isnan(steps_since_observable(np.full(40, 0.3), DT)))
    assert np.all(np.isnan(steps_since_observable(np.zeros(40), DT)))
