"""Choices on one condition become a branch, with what only one side needs; the results stay."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from traced import Inputs, Pair, State, compiled, python_text

from gapsense.kernels.elementary import log
from gapsense.kernels.emit import Python
from gapsense.kernels.kernel import trace
from gapsense.kernels.trace import cond, load, sqrt, store, where


def shared(a: Any, b: Any, c: Any) -> Any:
    """Two choices on one condition, and a root and a logarithm of which only one is needed."""
    root, other = sqrt(a) * c, log(-a) * c
    return where(a > 0.0, root, other), where(a > 0.0, root * root, b)


def test_choices_on_one_condition_share_a_branch() -> None:
    text = python_text(shared, Pair)
    assert text.count("if ") == 1 and " else " not in text


def test_only_the_side_that_is_chosen_is_computed() -> None:
    step = compiled(python_text(shared, Pair))
    assert step((4.0, 7.0, 3.0)) == (6.0, 36.0)
    assert step((-1.0, 7.0, 3.0)) == (0.0, 7.0)


def test_a_choice_joins_the_branch_on_its_condition() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        x = cond(a > b, lambda: sqrt(c), lambda: c)
        return x, where(a > b, b * c, a * c)

    text = python_text(function, Pair)
    assert text.count("if ") == 1 and " else " not in text
    assert [compiled(text)(row) for row in ((2.0, 1.0, 9.0), (1.0, 2.0, 9.0))] == [(3.0, 9.0), (9.0, 9.0)]


def test_one_short_choice_stays_an_expression() -> None:
    assert " else " in python_text(lambda a, b, c: where(a > b, a * c, b))


def test_choices_that_need_each_other_in_turn() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        first = where(a > 0.0, b, c)
        second = where(b > 0.0, first + 1.0, a)
        third = where(a > 0.0, second * 2.0, first - second)
        return third, where(b > 0.0, third, first * second)

    step = compiled(python_text(function, Pair))
    for row in [(x, y, 0.5) for x in (-2.0, 2.0) for y in (-3.0, 3.0)]:
        assert step(row) == function(*row)


def test_a_choice_of_what_another_on_the_same_condition_has_chosen() -> None:
    def function(a: Any, b: Any, c: Any) -> Any:
        first = where(a > 0.0, b + c, c)
        return first, where(a > 0.0, (first * b + 1.0) * (first - b), 0.0)

    assert compiled(python_text(function, Pair))((1.0, 2.0, 3.0)) == function(1.0, 2.0, 3.0)


def test_memory_is_read_before_it_changes_though_only_one_side_needs_it() -> None:
    def step(state: State, inputs: Inputs) -> Any:
        before = load(state.memory, 1.0)
        state = State(store(state.memory, 1.0, inputs.a))
        return state, Pair(where(inputs.a > 0.0, before * 2.0, 7.0), where(inputs.a > 0.0, before + 1.0, inputs.b))

    function = compiled(Python(trace(step, {"state": State, "inputs": Inputs})).source())
    memory = [3.0] * 5
    assert function((memory,), (5.0, 1.0, 0.0))[1] == (6.0, 4.0)
    assert function((memory,), (-5.0, 1.0, 0.0))[1] == (7.0, 1.0)
    assert memory == [3.0, -5.0, 3.0, 3.0, 3.0]


STEPS = st.lists(
    st.tuples(st.sampled_from(["where", "where", "where", "+", "*", "cond", "test"]), *3 * [st.integers(0, 40)]),
    min_size=4,
    max_size=40,
)


def evaluate(steps: list[tuple[str, int, int, int]], *values: Any) -> Any:
    """A program whose values are used many times, with choices on few conditions."""
    found, tests = [*values], [values[0] > values[1], values[1] > values[2]]
    for op, *places in steps:
        i, j, k = (found[place % len(found)] for place in places)
        c = tests[places[0] % len(tests)]
        if op == "test":
            tests.append(j > k)
        elif op == "cond":
            found += cond(c, lambda j=j, k=k: (j + 0.5, k), lambda i=i, k=k: (k * 0.5, i))  # type: ignore[misc]
        else:
            found.append(where(c, j, k) if op == "where" else i + j if op == "+" else i * 0.5 - k)
    return sum(found[1:], found[0]), found[-1] + 0.0 * values[0]


@settings(max_examples=150)
@given(STEPS, st.tuples(*3 * [st.floats(-3.0, 3.0)]))
def test_random_programs_give_the_same_bits(steps: Any, values: tuple[float, float, float]) -> None:
    found = compiled(python_text(lambda *given: evaluate(steps, *given), Pair))(values)
    for one, other in zip(found, evaluate(steps, *values)):
        assert one == other or (math.isnan(one) and math.isnan(other))
