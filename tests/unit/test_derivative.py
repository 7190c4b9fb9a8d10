"""Derivatives on the graph, against complex steps, finite differences and known formulas."""

from __future__ import annotations

import cmath
import math
import random
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from traced import Inputs, Outputs, Parameters, State, compiled, python_text, run_python

from gapsense.kernels.derivative import derivative, jacobian, linearise
from gapsense.kernels.elementary import exp, log, tanh
from gapsense.kernels.emit import Python
from gapsense.kernels.kernel import trace
from gapsense.kernels.trace import TraceError, cond, fabs, floor, load, locate, loop, sqrt, square, store, where


def slope(function: Callable[..., Any]) -> Callable[..., float]:
    """Generated code of df/da at (a, b, c)."""
    step = compiled(python_text(lambda a, b, c: derivative(function(a, b, c), a)))
    return lambda *values: step(values)[0]


SMOOTH = {
    "sqrt": (sqrt, cmath.sqrt), "log": (log, cmath.log), "exp": (exp, cmath.exp), "tanh": (tanh, cmath.tanh),
}  # fmt: skip


@pytest.mark.parametrize("name", SMOOTH)
def test_derivative_equals_complex_step(name: str) -> None:
    real, imaginary = SMOOTH[name]

    def formula(f: Any, a: Any, b: Any, c: Any) -> Any:
        return (b * f(a * a + b) - c) / (a + c * f(b + a)) + -(a - c) * a

    for a, b, c in ((0.7, 1.3, 2.1), (1.9, 0.2, 0.4)):
        expected = formula(imaginary, complex(a, 1e-30), b, c).imag / 1e-30
        assert slope(lambda a, b, c: formula(real, a, b, c))(a, b, c) == pytest.approx(expected, rel=1e-13)


def test_derivative_through_where_and_fabs_is_that_of_the_side_taken() -> None:
    f = slope(lambda a, b, c: where(a > b, square(a), 3.0 * a) + fabs(a - c))
    assert f(2.0, 1.0, 0.0) == 4.0 + 1.0
    assert f(0.5, 1.0, 2.0) == 3.0 - 1.0


def test_derivative_through_guarded_where_is_finite() -> None:
    def guarded(a: Any, b: Any, c: Any) -> Any:
        is_usable = a > 0.0
        return where(is_usable, 1.0 / where(is_usable, a, 1.0), b)

    assert slope(guarded)(2.0, 0.0, 0.0) == -0.25
    assert slope(guarded)(0.0, 0.0, 0.0) == 0.0


def test_derivative_through_nested_cond_computes_the_branch_taken_only() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        before = a * a
        inner = cond(a > 0.0, lambda: cond(b > 0.0, lambda: before * b + log(a), lambda: before), lambda: c)
        return inner * a

    f = slope(function)
    assert f(2.0, 3.0, 5.0) == pytest.approx((2 * 2.0 * 3.0 + 0.5) * 2.0 + function(2.0, 3.0, 5.0) / 2.0)
    assert f(2.0, -3.0, 5.0) == pytest.approx(3 * 4.0)
    assert f(-2.0, 3.0, 5.0) == 5.0  # log(a) would fail


def test_branches_with_the_same_derivative_need_no_condition() -> None:
    assert "if" not in python_text(lambda a, b, c: derivative(cond(b > c, lambda: 2.0 * a + b, lambda: 2.0 * a), a))


def test_derivative_of_steps_is_zero() -> None:
    assert slope(lambda a, b, c: floor(a) + where(a > b, 1.0, 2.0))(1.5, 1.0, 0.0) == 0.0


def test_derivative_of_table_interpolation_is_its_slope() -> None:
    def step(inputs: Inputs, par: Parameters) -> Outputs:
        k = locate(par.table, inputs.a)
        y0, y1 = load(par.table, k), load(par.table, k, 1)
        return Outputs(derivative(y0 * y0 + (y1 * y1 - y0 * y0) * (inputs.a - y0) / (y1 - y0), inputs.a))

    f = compiled(Python(trace(step, {"inputs": Inputs, "par": Parameters})).source())
    assert f((2.0, 0.0, 0.0), ([0.0, 1.0, 4.0],))[0] == pytest.approx(5.0)


def test_derivative_through_a_loop_is_refused_and_of_an_independent_loop_zero() -> None:
    def root(start: Any, value: Any) -> Any:
        return loop(9, lambda x: ((0.5 * (x + value / x),), False), (start,))[0]

    with pytest.raises(TraceError, match=r"through loop\(\) is not supported"):
        python_text(lambda a, b, c: derivative(b * root(1.0, a), a))
    with pytest.raises(TraceError, match=r"through loop\(\) is not supported"):
        python_text(lambda a, b, c: derivative(b * root(a, b), a))
    assert slope(lambda a, b, c: a * root(1.0, b))(1.0, 4.0, 0.0) == pytest.approx(2.0)


def test_derivative_inside_a_loop_by_its_own_variable() -> None:
    def newton(a: Any, b: Any, c: Any) -> Any:
        def improve(x: Any, n: Any) -> Any:
            residual = cond(b > 0.0, lambda: x * x * x - a + 0.0 * n, lambda: x - a)
            return (x - residual / derivative(residual, x), n + 1.0), fabs(residual) < 1e-14

        return loop(50, improve, (c + 1.0, c))[0]

    step = compiled(python_text(newton))
    assert step((8.0, 1.0, 0.0))[0] == pytest.approx(2.0, rel=1e-14)
    assert step((8.0, -1.0, 0.0))[0] == pytest.approx(8.0, rel=1e-14)


def test_derivative_through_array_memory_is_refused() -> None:
    def step(state: State, inputs: Inputs) -> Outputs:
        memory = store(state.memory, 0.0, square(inputs.a))
        return Outputs(derivative(load(memory, 0.0), inputs.a))

    with pytest.raises(TraceError, match="array memory"):
        trace(step, {"state": State, "inputs": Inputs})


def test_derivative_by_a_constant_is_refused() -> None:
    with pytest.raises(TraceError, match="constant"):
        python_text(lambda a, b, c: derivative(a, 2.0))  # type: ignore[arg-type]


def test_jacobian_holds_the_other_variables_even_if_they_depend_on_each_other() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        x = a * b
        y = x + c  # computed from x, and yet another variable
        return sum(jacobian([x * y, y * y], [x, y]).ravel() * np.array([1.0, 10.0, 100.0, 1000.0]))

    a, b, c = 2.0, 3.0, 5.0
    x, y = 6.0, 11.0
    assert compiled(python_text(function))((a, b, c))[0] == y + 10.0 * x + 1000.0 * 2.0 * y


def test_linearise_takes_constants_among_traced_values() -> None:
    """Two that are equal too: each has a derivative of its own."""

    def bent(x: Any, r: Inputs) -> Any:
        return [x[0] * x[1] * r.b, x[1] * x[1] + x[2]]

    def function(a: Any, b: Any, c: Any) -> Any:
        values, J = linearise(bent, [a, 3.0, 3.0], Inputs(a, b, c))
        return (values @ np.array([1.0, 10.0])) + (J.ravel() @ np.array([1.0, 10.0, 100.0, 1e3, 1e4, 1e5]))

    a, b = 2.0, 5.0
    J = [3.0 * b, a * b, 0.0, 0.0, 6.0, 1.0]
    expected = a * 3.0 * b + 10.0 * 12.0 + np.dot(J, [1.0, 10.0, 100.0, 1e3, 1e4, 1e5])
    assert run_python(function, a, b, 0.0) == expected


def test_jacobian_by_one_value_twice_is_refused() -> None:
    with pytest.raises(TraceError, match="same traced value"):
        python_text(lambda a, b, c: jacobian([a * b], [a, a])[0, 0])


POLYNOMIAL = st.lists(
    st.tuples(
        st.sampled_from(["+", "-", "*", "/", "where", "cond", "tanh", "exp"]), st.integers(0, 9), st.integers(0, 9)
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=100, suppress_health_check=list(HealthCheck))
@given(POLYNOMIAL, st.integers(0, 2**32))
def test_random_programs_against_finite_differences(program: list[tuple[str, int, int]], seed: int) -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        values = [a, b, c]
        for op, i, j in program:
            x, y = values[i % len(values)], values[j % len(values)]
            values.append({
                "+": lambda x, y: x + y, "-": lambda x, y: x - y, "*": lambda x, y: 0.5 * x * y,
                "/": lambda x, y: x / (1.0 + square(y)), "where": lambda x, y: where(b > c, x, y),
                "cond": lambda x, y: cond(b > c, lambda: x * y, lambda: tanh(x)),
                "tanh": lambda x, y: tanh(x) * y, "exp": lambda x, y: exp(-square(x)) * y,
            }[op](x, y))  # fmt: skip
        return values[-1]

    rng = random.Random(seed)
    a, b, c = (rng.uniform(-1.0, 1.0) for _ in range(3))
    h = 1e-5
    numeric = (
        8 * (function(a + h, b, c) - function(a - h, b, c)) - (function(a + 2 * h, b, c) - function(a - 2 * h, b, c))
    ) / (12 * h)
    assert slope(function)(a, b, c) == pytest.approx(numeric, rel=1e-6, abs=1e-8)


class Constants(NamedTuple):
    k: Any
    c: Any


def curve(x: Any, pair: Constants) -> Any:
    return [pair.k * x[0] * log(x[1]), x[1] * x[1] + pair.c, cond(x[0] > 0.0, lambda: x[0] * x[1], lambda: pair.c)]


def test_linearise_holds_what_was_computed_from_the_variables_too() -> None:
    """Traced as on floats: a record is a constant, wherever it comes from."""

    def slope_of(a: Any, b: Any, _: Any) -> Any:
        return linearise(curve, [a, b], Constants(a * b, a + b))[1][0, 0]

    assert run_python(slope_of, 1.5, 2.0, 0.0) == slope_of(1.5, 2.0, 0.0) == pytest.approx(3.0 * math.log(2.0))


@pytest.mark.parametrize("x", [(1.5, 2.0), (-1.5, 0.25)])
def test_linearise_gives_value_and_jacobian_on_floats_and_the_same_bits_traced(x: tuple[float, float]) -> None:
    values, J = linearise(curve, x, Constants(3.0, 0.5))
    a, b = x
    assert values.tolist() == [3.0 * a * math.log(b), b * b + 0.5, a * b if a > 0.0 else 0.5]
    slopes = [[3.0 * math.log(b), 3.0 * a / b], [0.0, 2.0 * b], [b, a] if a > 0.0 else [0.0, 0.0]]
    np.testing.assert_allclose(J.astype(float), slopes, rtol=1e-15)
    for row in range(3):
        for column in range(2):
            traced = run_python(
                lambda p, q, k, i=row, j=column: linearise(curve, (p, q), Constants(k, 0.5))[1][i, j], *x, 3.0
            )
            assert traced == J[row, column]
