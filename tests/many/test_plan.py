"""The plan of a study: all combinations in a stable order, by number, and never another one."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.cosim.scenario.records import Block, Plan, Port
from gapsense.many.prepare import Study, read_study


def load_study(path: Path) -> Study:
    """The study of a file without problems."""
    problems: list[str] = []
    study = read_study(path, problems)
    assert study is not None, problems
    assert not problems
    return study


def block(name, *columns):
    return Block({Port(name, str(k)): column for k, column in enumerate(columns)})


SIZES = st.lists(st.integers(1, 5), max_size=4)


@given(SIZES, st.integers(1, 3), st.booleans())
def test_points_are_the_product_of_the_blocks_in_order(sizes, seeds, is_common):
    blocks = tuple(
        block(f"c{k}", [10 * k + j for j in range(size)], [-j for j in range(size)]) for k, size in enumerate(sizes)
    )
    plan = Plan(blocks, seeds, is_common)
    expected = [
        {port: value for b, row in zip(blocks, rows) for port, value in b.row(row).items()}
        for rows in product(*map(range, sizes))
    ]
    assert len(plan) == seeds * len(expected)
    assert [plan.values(k) for k in range(len(plan))] == expected * seeds
    shifts = [plan.shift(k) for k in range(len(plan))]
    assert shifts == [k // len(expected) for k in range(len(plan))] if is_common else list(range(len(plan)))


@settings(max_examples=20)
@given(st.integers(0, 2**32), st.integers(1001, 1200), st.integers(1, 3))
def test_telling_points_have_the_extremes_of_many_values_and_every_one_of_few(seed, count, size):
    values = np.random.default_rng(seed).normal(size=count)
    plan = Plan((block("many", values), block("few", [f"v{k}" for k in range(size)])))
    points = [plan.point(number) for number in plan.telling()]
    seen = {point[Port("many", "0")] for point in points}
    assert {min(values), max(values)} <= seen
    assert {point[Port("few", "0")] for point in points} == {f"v{k}" for k in range(size)}
    assert len(points) < 1100


def test_values_of_numpy_come_as_those_of_python():
    plan = Plan((block("a", np.array([1.5]), np.array([2]), np.array([True]), np.array(["x"], dtype=object)),))
    assert [type(value) for value in plan.point(0).values()] == [float, int, bool, str]


TEXT = """
title = "All kinds"
scenario = "semera_valve"
seeds = 3
noise = "common"
rows = "rows.csv"
[grid]
"a.list" = [2, "two", true]
[[ranges]]
parameter = "a.even"
from = 1
to = 5
count = 3
[[ranges]]
parameter = "a.ratio"
from = 1.0
to = 100.0
count = 3
spacing = "log"
[sample]
method = "latin-hypercube"
count = 4
seed = 2
[[sample.factors]]
parameter = "b.uniform"
distribution = "uniform"
low = 0.0
high = 1.0
[[sample.factors]]
parameter = "b.choice.deep"
distribution = "choice"
values = ["p", "q"]
[[sample.factors]]
parameter = "b.whole"
distribution = "integer"
low = 1
high = 9
"""


def test_every_kind_of_factor_of_a_file(tmp_path):
    (tmp_path / "rows.csv").write_text("c.x [V],c.y\n1.0,true\n2.0,false\n")
    (tmp_path / "study.toml").write_text(TEXT)
    study = load_study(tmp_path / "study.toml")
    plan = study.plan
    assert (plan.points, len(plan), plan.is_common) == (2 * 4 * 3 * 3 * 3, 3 * 216, True)
    assert list(map(str, plan.ports)) == [
        "c.x",
        "c.y",
        "b.uniform",
        "b.choice.deep",
        "b.whole",
        "a.list",
        "a.even",
        "a.ratio",
    ]
    first, second, last = plan.point(0), plan.point(1), plan.point(plan.points - 1)
    assert (first["c", "x"], first["a", "list"], first["a", "even"], first["a", "ratio"]) == (1.0, 2, 1, 1.0)
    assert (second["a", "ratio"], last["a", "even"], last["c", "y"]) == (10.0, 5, False)
    assert type(first["a", "even"]) is int
    assert type(first["b", "whole"]) is int and 1 <= first["b", "whole"] <= 9
    assert len({plan.point(k)["b", "uniform"] for k in range(plan.points)}) == 4
    again = load_study(tmp_path / "study.toml").plan
    assert [again.values(k) for k in range(len(again))] == [plan.values(k) for k in range(len(plan))]
