"""Every operation of kernels, in C over runs: the bits of C on one double, whatever the runs beside it do."""

from __future__ import annotations

import ctypes
import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_code import build_graph
from traced import Parameters, State, graph

from gapsense.kernels.elementary import exp, log, tanh
from gapsense.kernels.kernel import trace
from gapsense.kernels.lanes import Array, Code, plan
from gapsense.kernels.lanes.library import HERE, address, compile_library, source, tuning_options, with_types
from gapsense.kernels.trace import cond, fabs, floor, load, locate, loop, not_, sqrt, store, where  # fmt: skip

ODD = (0.0, -0.0, 1.0, -1.0, 2.5, -7.3, 1e-300, 1e300, float("inf"), float("-inf"), float("nan"))


def rows(count: int) -> np.ndarray:
    """Odd numbers in all pairs, and ordinary ones: (3, runs)."""
    rng = np.random.default_rng(1)
    pairs = np.array([[a, b, rng.normal()] for a, b in product(ODD, ODD)])
    return np.concatenate([pairs, rng.normal(0.0, 3.0, (count, 3))]).T


def run_lanes(function: Any, columns: np.ndarray) -> np.ndarray:
    code = Code(graph(function))
    made = plan(lambda given: code(given), given=3)
    assert made.library
    return made.run(columns.shape[1], given=columns)[0]


def run_one_by_one(function: Any, columns: np.ndarray, folder: Path) -> list[float]:
    """The same by the C for one double."""
    g = graph(function)
    library = build_graph(g, folder)
    found, none = (ctypes.c_double * 1)(), ctypes.c_void_p(None)
    results = []
    for column in columns.T:
        library.step(none, none, (ctypes.c_double * 3)(*column), none, none, none, found)
        results.append(found[0])
    return results


def bits(values: Any) -> Any:
    """As whole numbers; all that are no numbers are the same."""
    found = np.asarray(values, float)
    return np.where(np.isnan(found), -1, found.view(np.int64))


def arithmetic(a: Any, b: Any, c: Any) -> Any:
    return (a + b) * c - a / (b - 0.3) + -c


def elementary(a: Any, b: Any, c: Any) -> Any:
    return exp(a) + log(b) + sqrt(fabs(c)) - tanh(c) + floor(a * 1.7)


def comparisons(a: Any, b: Any, c: Any) -> Any:
    marks = [a < b, a <= b, a > b, a >= b, a == b, a != b, not_(a < c), (a < b) & (b < c), (a > b) | (b != b)]
    total = c
    for k, mark in enumerate(marks):
        total = total + where(mark, 2.0**k, 0.0)
    return total


def branches(a: Any, b: Any, c: Any) -> Any:
    def inner() -> Any:
        return cond(b > c, lambda: (log(b), a > c, c), lambda: (b * 0.1, True, a))

    x, flag, y = cond(a > 0.0, inner, lambda: (exp(a), b > 0.0, 7.0))
    return where(flag, x, y) + x


def loops(a: Any, b: Any, c: Any) -> Any:
    def body(x: Any, n: Any, seen: Any) -> Any:
        new = 0.5 * (x + cond(n > 3.0, lambda: a / x, lambda: a * x))
        return (new, n + 1.0, seen | (new > c)), fabs(new - x) <= fabs(b)

    x, n, seen = cond(c > -1.0, lambda: loop(9, body, (a, 0.0, False)), lambda: (b, 100.0, True))
    return where(seen, x, -x) + n


@pytest.mark.parametrize("function", [arithmetic, elementary, comparisons, branches, loops])
def test_bits_are_those_of_one_double(function, compiler, tmp_path):
    columns = rows(90)
    expected = run_one_by_one(function, columns, tmp_path)
    np.testing.assert_array_equal(bits(run_lanes(function, columns)), bits(expected))


@pytest.mark.parametrize("options", [("-mno-avx512f",), ("-mno-avx",)], ids=str)
def test_bits_do_not_depend_on_the_width_of_vectors(options, compiler, tmp_path):
    code, columns = Code(graph(loops)), rows(90)
    made = plan(lambda given: code(given), given=3)
    expected = made.run(columns.shape[1], given=columns)
    flags, about = tuning_options(compiler)
    if "__x86_64__" not in about:
        pytest.skip("another processor than x86-64, whose options these are")
    command = (*compiler, *flags, *options)
    texts = {"function": source(code), "caller": with_types((HERE / "run.c").read_text(encoding="utf-8"))}
    narrow = {name: ctypes.CDLL(str(compile_library(text, command, tmp_path, name))) for name, text in texts.items()}
    del made._called
    made.__dict__ |= {"library": narrow["caller"], "_addresses": [address(narrow["function"], "NAME")]}
    assert made.library.width() == (2 if "-mno-avx" in options or "__AVX__" not in about else 4)
    np.testing.assert_array_equal(bits(made.run(columns.shape[1], given=columns)), bits(expected))


@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 16, 33])
def test_a_run_does_not_depend_on_those_beside_it(count, compiler):
    columns = rows(0)[:, :33]
    whole = run_lanes(branches, columns)
    np.testing.assert_array_equal(bits(run_lanes(branches, columns[:, :count])), bits(whole[:count]))
    np.testing.assert_array_equal(bits(run_lanes(branches, columns[:, -count:])), bits(whole[-count:]))


def test_memory_changes_in_the_runs_that_take_a_branch_or_round_and_tables_are_searched(compiler):
    def step(state: State, table: Any) -> Any:
        memory, x = state.memory, load(state.memory, 1.0)
        k = locate(table.table, x)
        y = load(table.table, k, 1) + load(table.table, k) * x + k
        stored = cond(x > 0.0, lambda: store(memory, where(x > 1.0, 0.0, 4.0), y), lambda: memory)
        stored, _ = loop(4, lambda m, n: ((store(m, n, load(m, n) - 0.5 * x), n + 1.0), n > 1.0 + x), (stored, 0.0))
        return State(store(stored, 2.0, load(stored, 4.0) + x))

    code = Code(trace(step, {"state": State, "table": Parameters}))
    # the memory is given as a table, which it changes in place, so that one can look at it
    made = plan(lambda memory, table: code((memory,), (table,)) and (), memory=Array.TABLE, table=Array.TABLE)
    assert made.library
    table, memory = [-1.0, 0.0, 0.5, 4.0], np.random.default_rng(2).normal(0.0, 1.5, (5, 19))
    expected = [step(State([*map(float, run)]), Parameters(table)).memory for run in memory.T]
    made.run(19, memory=memory, table=table)
    np.testing.assert_array_equal(bits(memory.T), bits(expected))


def test_source_has_no_number_of_the_model():
    code = [Code(graph(lambda a, b, c, k=k: where(a > k, b * k, c) + 1.0)) for k in (0.125, 17.5)]
    assert source(code[0]) == source(code[1])
    assert [c.c.constants.tolist() for c in code] == [[0.125], [17.5]]
    assert not re.search(r"17\.5|0\.125", source(code[0]))
