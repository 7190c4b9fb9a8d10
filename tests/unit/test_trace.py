"""The tracer: what it records, shares, leaves out and refuses, and that all printed forms compute the same."""

from __future__ import annotations

import inspect
import math
import random
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from traced import Outputs, Pair, Parameters, State, compiled, graph, memory_step, python_text, run_c, run_python

from gapsense.kernels.elementary import exp, log, tanh
from gapsense.kernels.emit import C, Python
from gapsense.kernels.kernel import trace
from gapsense.kernels.layout import Array, Memory, zeros
from gapsense.kernels.trace import (
    Tape,
    TraceError,
    clip,
    cond,
    fabs,
    floor,
    load,
    locate,
    loop,
    not_,
    sqrt,
    square,
    store,
    where,
)


class Point(NamedTuple):
    x: Any
    ahead: Any


def line_of(function: Any, text: str) -> int:
    lines, start = inspect.getsourcelines(function)
    return start + next(k for k, line in enumerate(lines) if text in line)


# ---- what is refused


def by_if(a: Any, b: Any, c: Any) -> Any:
    if a > b:  # here
        return a
    return c


def by_power(a: Any, b: Any, c: Any) -> Any:
    return b + a**2  # here


def by_power_of_two(a: Any, b: Any, c: Any) -> Any:
    return 2.0**a  # here


def by_float(a: Any, b: Any, c: Any) -> Any:
    return math.sqrt(a)  # here


def by_index(a: Any, b: Any, c: Any) -> Any:
    return [1.0, 2.0][a]  # here


def by_array_condition(a: Any, b: Any, c: Any) -> Any:
    return max(np.array([a, b], dtype=object))  # here


def by_truth_arithmetic(a: Any, b: Any, c: Any) -> Any:
    return (a > b) - (a < b)  # here


def by_where_on_arrays(a: Any, b: Any, c: Any) -> Any:
    return where(a > b, np.zeros(2), np.ones(2))  # here


def by_branches_of_unequal_length(a: Any, b: Any, c: Any) -> Any:
    return cond(a > b, lambda: (a, b), lambda: (a,))  # here


@pytest.mark.parametrize(
    "function",
    [
        by_if,
        by_power,
        by_power_of_two,
        by_float,
        by_index,
        by_array_condition,
        by_truth_arithmetic,
        by_where_on_arrays,
        by_branches_of_unequal_length,
    ],
)
def test_what_cannot_be_traced_raises_an_error_that_names_the_line(function: Any) -> None:
    with pytest.raises(TraceError) as error:
        graph(function)
    assert f"{__file__}:{line_of(function, '# here')}, in {function.__name__}" in str(error.value)


def test_loop_body_must_return_as_many_values_as_the_state_has() -> None:
    with pytest.raises(TraceError, match="returns 1 values for a state of 2"):
        graph(lambda a, b, c: loop(3, lambda x, y: ((x + y,), x > c), (a, b))[0])


@pytest.mark.parametrize(
    "hide",
    [
        lambda kept, a: cond(a > 0.0, lambda: kept.append(a * 2.0) or a, lambda: -a),
        lambda kept, a: loop(3, lambda x: (kept.append(x * 2.0) or (x + 1.0,), x > 5.0), (a,))[0],
    ],
)
def test_values_that_leave_a_branch_or_a_loop_by_the_back_door_are_refused(hide: Any) -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        kept: list[Any] = []
        return hide(kept, a) + kept[-1]

    with pytest.raises(TraceError, match="return it from there"):
        python_text(function)


# ---- what is left out and shared


def test_common_subexpressions_are_computed_once() -> None:
    text = python_text(lambda a, b, c: sqrt(a * b + c) + 1.0 / sqrt(b * a + c))
    assert text.count("sqrt(") == 1 and text.count("*") == 1


def test_structural_zeros_and_ones_vanish() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        F = np.array([[1.0, 0.0], [0.0, -1.0]], dtype=object)
        x = F @ np.array([a, b], dtype=object)
        return 0.0 * c + x[0] / 1.0 + 0.0 / c - 0.0 + (0.0 - x[1]) + x[0] * 0.0

    assert python_text(function).count("*") == 0
    assert run_python(function, 3.0, 5.0, 7.0) == 8.0


def test_dead_code_is_not_printed() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        exp(a)
        kept, _ = cond(a > b, lambda: (a * 2.0, log(a)), lambda: (b * 2.0, log(b)))
        return kept

    text = python_text(function)
    assert "exp" not in text and "log" not in text


def test_constant_zero_keeps_its_sign_in_branches() -> None:
    assert math.copysign(1.0, run_python(lambda a, b, c: cond(a > 0.0, lambda: -0.0, lambda: 0.0), 1.0, 0.0, 0.0)) == -1


def test_where_with_equal_operands_needs_no_condition() -> None:
    assert "if" not in python_text(lambda a, b, c: where(a > b, c, c))


def test_logic_with_constants_folds() -> None:
    assert python_text(lambda a, b, c: where((a > b) & True, b, c)) == python_text(lambda a, b, c: where(a > b, b, c))
    assert run_python(lambda a, b, c: where((a > b) | True, b, c), 0.0, 1.0, 2.0) == 1.0
    assert run_python(lambda a, b, c: where(not_(a > b) & False, b, c), 0.0, 1.0, 2.0) == 2.0


def test_infinite_constants_can_be_printed(tmp_path: Path) -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        return clip(a, -math.inf, b) + where(a > math.inf, math.nan, c)

    for run in (run_python, lambda f, *v: run_c(f, tmp_path, *v)):
        assert run(function, 3.0, 2.0, 1.0) == 3.0


# ---- branches


def test_only_the_branch_taken_is_computed_in_scalar_code() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        return cond(a > 0.0, lambda: b / a, lambda: c)

    assert run_python(function, 0.0, 1.0, 5.0) == 5.0
    assert run_python(function, 2.0, 1.0, 5.0) == 0.5


def test_branches_may_return_constants_outer_values_and_truth_values(tmp_path: Path) -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        x, y, z, flag = cond(a > b, lambda: (1.0, c, b, a > 5.0), lambda: (2, c, a * a, False))
        return cond(flag & (c > 0.0), lambda: x + y, lambda: x - z)

    for values in ((6.0, 1.0, 2.0), (3.0, 1.0, 2.0), (1.0, 3.0, 2.0), (6.0, 1.0, -2.0)):
        expected = function(*values)
        assert run_python(function, *values) == expected
        assert run_c(function, tmp_path / str(values), *values) == expected


def test_a_branch_uses_what_the_function_has_computed_and_the_function_not_what_a_branch_has() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        before = exp(a)
        inside = cond(b > 0.0, lambda: exp(a) + log(b), lambda: before)
        return inside + where(b > 0.0, log(where(b > 0.0, b, 1.0)), 0.0)

    assert python_text(function).count("exp(") == 1
    for b in (2.0, -1.0):
        assert run_python(function, 0.3, b, 0.0) == function(0.3, b, 0.0)


# ---- loops


def newton(a: Any, b: Any, c: Any) -> Any:
    """Square root of `a`, with a loop that starts from a constant and has a condition and a loop inside."""

    def improve(x: Any, n: Any) -> Any:
        step = cond(n < 40.0, lambda: loop(2, lambda s: ((s * 0.5,), False), (x - a / x,))[0] * 2.0, lambda: c)
        new = x - step
        return (new, n + 1.0), fabs(new * new - a) <= b

    x, n = loop(60, improve, (1.0, 0.0))
    return x + 1e-3 * n


@pytest.mark.parametrize("a", [2.0, 9.0, 1e-3, 1.0])
def test_loop_stops_where_it_should(a: float, tmp_path: Path) -> None:
    expected = newton(a, 1e-9, 0.0)
    assert run_python(newton, a, 1e-9, 0.0) == expected
    assert run_c(newton, tmp_path, a, 1e-9, 0.0) == expected


def test_loop_over_constants_only_is_unrolled() -> None:
    assert "for" not in python_text(lambda a, b, c: a * loop(5, lambda x: ((x * 2.0,), False), (1.0,))[0])


def test_loop_with_truth_value_as_state(tmp_path: Path) -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        x, seen = loop(4, lambda x, seen: ((x + b, seen | (x > c)), False), (a, False))
        return where(seen & (x > 0.0), x, -1.0)

    for values in ((0.0, 1.0, 2.5), (0.0, 1.0, 9.0)):
        expected = function(*values)
        assert run_python(function, *values) == run_c(function, tmp_path / str(values), *values) == expected


def test_loop_whose_variables_change_places_and_stops_by_what_they_were(tmp_path: Path) -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        x, y, n = loop(9, lambda x, y, n: ((y, x + y, n + 1.0), x + n > c), (a, b, 0.0))
        return x * 100.0 + y * 10.0 + n

    for k, c in enumerate((0.0, 5.0, 40.0, 1e9)):
        expected = function(1.0, 2.0, c)
        assert run_python(function, 1.0, 2.0, c) == expected
        assert run_c(function, tmp_path / str(k), 1.0, 2.0, c) == expected


def test_which_branch_was_taken_is_its_condition() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        x, is_first = cond(a > b, lambda: (sqrt(b), True), lambda: (c, False))
        return where(is_first, x, a)

    assert "True" not in python_text(function)
    assert [run_python(function, a, 4.0, 7.0) for a in (5.0, 3.0)] == [2.0, 3.0]


def test_loop_over_records_reads_them_by_name() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        def body(left: Any, at: Point) -> Any:
            return (left - 1.0, at._replace(x=at.x + b, ahead=at.ahead * at.x)), left <= 1.0

        left, at = loop(9, body, (c, Point(a, np.array([1.0, b], dtype=object))))
        return at.x + left * at.ahead[0] + at.ahead[1]

    assert run_python(function, 1.5, 0.3, 4.0) == function(1.5, 0.3, 4.0)
    assert "for" in python_text(function)


def test_what_was_computed_before_the_loop_is_not_computed_in_it() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        growth = exp(b)
        return loop(5, lambda x: ((x + exp(b),), x > c), (growth * a,))[0]

    text = python_text(function)
    assert text.count("exp(") == 1 and text.index("exp(") < text.index("for ")


# ---- array memory and tables


def remember(state: State, inputs: Any, par: Parameters) -> Any:
    """Keeps the last five values of `a`; writes twice and reads before, between and after."""
    memory, k = state.memory, inputs.b
    before = load(memory, k)
    memory = store(memory, k, inputs.a)
    between = load(memory, k)
    memory = store(memory, k, inputs.a * 2.0)
    x = inputs.c
    j = locate(par.table, x)
    width = load(par.table, j, 1) - load(par.table, j)
    after = load(memory, where(k > 0.0, k - 1.0, 4.0))
    return State(memory), Outputs(before + 10.0 * between + 100.0 * load(memory, k) + 1000.0 * after + 0.1 * width)


def test_memory_is_read_and_written_in_order() -> None:
    from traced import Inputs

    g = trace(remember, {"state": State, "inputs": Inputs, "par": Parameters})
    scalar = compiled(Python(g).source().replace("def remember", "def step"))
    rng = random.Random(3)
    table = [0.0, 1.0, 3.0, 7.0]
    own, one = zeros(5), zeros(5)
    for k in range(12):
        given = Inputs(rng.random(), float(k % 5), rng.uniform(-1.0, 9.0))
        expected = remember(State(own), given, Parameters(table))[1].y
        assert scalar((one,), given, (table,))[1][0] == expected
        assert one == own


def test_memory_of_before_a_store_cannot_be_used_after_it() -> None:
    def step(state: State) -> Any:
        store(state.memory, 0.0, 1.0)
        return Outputs(load(state.memory, 0.0))

    with pytest.raises(TraceError, match=r"Use what store\(\) returned"):
        trace(step, {"state": State})


def test_store_inside_branches_changes_the_memory_of_the_runs_that_take_them() -> None:
    from traced import Inputs

    def step(state: State, inputs: Inputs) -> Any:
        def low() -> tuple[Any, Any]:
            memory = store(state.memory, inputs.b, inputs.a)
            return cond(inputs.c > 0.0, lambda: store(memory, 0.0, load(memory, inputs.b) + 1.0), lambda: memory), 1.0

        memory, y = cond(inputs.a < 0.5, low, lambda: (store(state.memory, 4.0, inputs.c), 2.0))
        return State(memory), Outputs(load(memory, 0.0) + y * load(memory, 4.0))

    g = trace(step, {"state": State, "inputs": Inputs})
    scalar = compiled(Python(g).source())
    rng = np.random.default_rng(1)
    own, one = [zeros(5) for _ in range(3)], [zeros(5) for _ in range(3)]
    for _ in range(40):
        runs = [Inputs(rng.random(), float(rng.integers(4)), rng.uniform(-1.0, 1.0)) for _ in range(3)]
        expected = [step(State(memory), given)[1].y for memory, given in zip(own, runs)]
        assert [scalar((memory,), given)[1][0] for memory, given in zip(one, runs)] == expected
        assert own == one


def test_store_inside_a_loop_changes_the_memory_of_the_runs_that_are_in_it(tmp_path: Path) -> None:
    """Branches and another loop in it too; in source, scalar Python and C."""
    from traced import Inputs

    def step(state: State, inputs: Inputs) -> Any:
        def inner(memory: Any, n: Any) -> Any:
            return (store(memory, n, load(memory, n) + inputs.a), n + 1.0), n >= inputs.b

        def body(memory: Any, k: Any) -> Any:
            memory = store(memory, k, load(memory, k) + inputs.c)
            memory = cond(k > 1.0, lambda: loop(4, inner, (memory, 0.0))[0], lambda: memory)
            return (memory, k + 1.0), k >= inputs.b

        before = load(state.memory, 1.0)
        memory, k = loop(4, body, (state.memory, 0.0))
        memory = store(memory, 4.0, k)
        return State(memory), Outputs(before + load(memory, 0.0) + 3.0 * load(memory, 2.0) + k)

    g = trace(step, {"state": State, "inputs": Inputs})
    scalar = compiled(Python(g).source())
    native = memory_step(g, tmp_path)
    rng = np.random.default_rng(1)
    own, one, other = ([zeros(5) for _ in range(3)] for _ in range(3))
    for _ in range(30):
        runs = [Inputs(rng.random(), float(rng.integers(4)), rng.uniform(-1.0, 1.0)) for _ in range(3)]
        expected = [step(State(memory), given)[1].y for memory, given in zip(own, runs)]
        assert [scalar((memory,), given)[1][0] for memory, given in zip(one, runs)] == expected
        assert [native(memory, given) for memory, given in zip(other, runs)] == expected
        assert own == one == other


def test_store_inside_a_loop_to_memory_that_is_not_its_own_is_refused() -> None:
    def outside(state: State) -> Any:
        def body(k: Any) -> Any:
            return (load(store(state.memory, 0.0, k), 0.0),), k > 3.0

        return Outputs(loop(5, body, (load(state.memory, 0.0),))[0])

    def carried(state: State) -> Any:
        def body(memory: Any, k: Any) -> Any:
            return (store(memory, 0.0, k), load(state.memory, 0.0)), k > 3.0

        memory, k = loop(5, body, (state.memory, load(state.memory, 0.0)))
        return State(memory), Outputs(k)

    with pytest.raises(TraceError, match="part of the loop's state"):
        trace(outside, {"state": State})
    with pytest.raises(TraceError, match=r"Use what store\(\) returned"):
        trace(carried, {"state": State})


def test_branches_cannot_exchange_array_memory() -> None:
    class Two(NamedTuple):
        left: Annotated[Array, Memory(5)]
        right: Annotated[Array, Memory(5)]

    def step(state: Two) -> Any:
        return Outputs(load(cond(load(state.left, 0) > 0.0, lambda: state.left, lambda: state.right), 0.0))

    with pytest.raises(TraceError, match="different array memory"):
        trace(step, {"state": Two})


def test_memory_must_start_as_zeros() -> None:
    def initial(inputs: Any) -> Any:
        return State([inputs.y, 0.0, 0.0, 0.0, 0.0])

    with pytest.raises(TraceError, match=r"must start as zeros\(5\)"):
        trace(initial, {"inputs": Outputs})


@given(
    st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=8, unique=True).map(sorted),
    st.floats(-12.0, 12.0) | st.integers(0, 7),
)
def test_locate_is_searchsorted_with_extrapolation(table: list[float], x: float) -> None:
    x = table[x % len(table)] if isinstance(x, int) else x
    assert locate(table, x) == np.clip(np.searchsorted(table, x) - 1, 0, len(table) - 2)


# ---- random graphs

LEAVES = st.sampled_from(["a", "b", "c"]) | st.floats(-4.0, 4.0).map(lambda v: round(v, 3))
TREES = st.recursive(
    LEAVES,
    lambda t: st.one_of(
        st.tuples(st.sampled_from(["+", "-", "*", "/", "<", "and"]), t, t),
        st.tuples(st.sampled_from(["neg", "fabs", "sqrt", "floor", "tanh", "exp", "log"]), t),
        st.tuples(st.sampled_from(["where", "cond"]), t, t, t),
        st.tuples(st.just("loop"), t, t),
    ),
    max_leaves=25,
)


def evaluate(tree: Any, names: dict[str, Any]) -> Any:
    """The value of a random tree, as a kernel would compute it."""
    if not isinstance(tree, tuple):
        return names[tree] if isinstance(tree, str) else tree
    op, *rest = tree
    if op == "cond":
        return cond(evaluate(rest[0], names) > 0.5, lambda: evaluate(rest[1], names), lambda: evaluate(rest[2], names))
    if op == "loop":
        start = evaluate(rest[0], names)
        return loop(
            4,
            lambda v, n: ((0.5 * v + tanh(evaluate(rest[1], {**names, "a": v, "c": n})), n + 1.0), fabs(v) < 0.3),
            (start, 0.0),
        )[0]
    x, *others = (evaluate(t, names) for t in rest)
    y = others[0] if others else 0.0
    return {
        "+": lambda: x + y, "-": lambda: x - y, "*": lambda: x * y, "/": lambda: x / (1.0 + square(y)),
        "<": lambda: where(x < y, 1.0, x), "and": lambda: where((x < 1.0) & not_(y <= x), y, 0.5),
        "neg": lambda: -x, "fabs": lambda: fabs(x), "sqrt": lambda: sqrt(fabs(x)), "floor": lambda: floor(x),
        "tanh": lambda: tanh(x), "exp": lambda: exp(-fabs(x)), "log": lambda: log(1.0 + fabs(x)),
        "where": lambda: where(x > y, y, others[1]),
    }[op]()  # fmt: skip


def same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))


class Three(NamedTuple):
    first: Any
    second: Any
    third: Any


@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(st.tuples(*3 * [TREES]), st.tuples(*3 * [st.floats(-3.0, 3.0)]))
def test_random_graphs_give_the_same_bits_in_source_python_and_c(
    tmp_path_factory: pytest.TempPathFactory, trees: tuple[Any, ...], values: tuple[float, float, float]
) -> None:
    """Three at a time, as a compiler takes longer to start than to compile them."""

    def function(a: Any, b: Any, c: Any) -> Any:
        return tuple(evaluate(tree, {"a": a, "b": b, "c": c}) + 0.0 * a for tree in trees)

    expected = function(*values)
    for found in (
        run_python(function, *values, outputs=Three),
        run_c(function, tmp_path_factory.mktemp("c"), *values, outputs=Three),
    ):
        assert len(found) == 3 and all(map(same, found, expected)), (found, expected)


def test_c_signature_is_the_same_for_every_kernel() -> None:
    text = C(graph(lambda a, b, c: (a + b, c), Pair)).source()
    told = "real *restrict state, real *const *memory, const real *restrict inputs, const real *restrict par,"
    assert " ".join(text.split()).startswith(f"void step({told}")


def test_tape_counts_every_node() -> None:
    tape = Tape()
    assert [tape.node("in", ()).id for _ in range(3)] == [0, 1, 2]
