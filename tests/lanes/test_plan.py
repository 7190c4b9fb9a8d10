"""Recorded calls: what is kept, the places that values share, and Python in place of C."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from traced import Pair, graph

from gapsense.kernels.lanes import Array, Code, plan
from gapsense.kernels.lanes.plan import KEEP, NOWHERE, TAKE

SAMPLES, RUNS = 40, 13


@pytest.fixture(scope="module")
def code() -> Code:
    return Code(graph(lambda a, b, c: (a * b + c, a - c), Pair))


def walk(code: Code, start: Any, noise: Any) -> list[Any]:
    """Every third result of a chain of calls, and once more the start, with a plain number in each call."""
    row, kept = start, [start[0], start[1]]
    for k, w in enumerate(noise):
        row = code((row[0], 0.5 - k % 2, w))
        kept += row[:1] if k % 3 == 0 else []
    return [*kept, *row]


def given() -> dict[str, Any]:
    rng = np.random.default_rng(3)
    return {"start": rng.normal(size=(2, 1)), "noise": rng.normal(size=(RUNS, SAMPLES)).T}


def test_plan_gives_what_the_calls_give_at_once(code, compiler):
    recorded = plan(lambda start, noise: walk(code, start, noise), start=2, noise=SAMPLES)
    assert recorded.library
    columns = given()
    start, runs = [float(x) for x in columns["start"][:, 0]], columns["noise"].T.tolist()
    expected = np.transpose([walk(code, start, noise) for noise in runs])
    np.testing.assert_array_equal(recorded.run(RUNS, **columns), expected)
    recorded.__dict__["library"] = None
    np.testing.assert_array_equal(recorded.run(RUNS, **columns), expected)


def test_values_share_places(code):
    recorded = plan(lambda start, noise: walk(code, start, noise), start=2, noise=SAMPLES)
    steps = recorded.program.steps
    assert recorded.program.room < 12 and len([at for function, at in steps if function == TAKE]) > SAMPLES
    assert len([at for function, at in steps if function == KEEP]) == len(recorded.kept)
    dead = [at for function, at in steps if function > KEEP and at[-1] == NOWHERE]
    assert len(dead) == SAMPLES - 1  # second results that nobody needs, but for the last


def test_zeros_of_both_signs_are_two_numbers(code, compiler):
    recorded = plan(lambda start: [*code((start[0], 1.0, 0.0)), *code((start[0], 1.0, -0.0))], start=1)
    found = recorded.run(1, start=np.array([-0.0]))
    assert np.signbit(found[:, 0]).tolist() == [False, True, True, False]


def test_columns_that_are_missing_or_too_many_are_named(code):
    recorded = plan(lambda start: code((*start, 1.0)), start=2)
    with pytest.raises(ValueError, match="columns other found, start expected"):
        recorded.run(1, other=[1.0, 2.0])


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"start": np.zeros((3, 1))}, r"`start` has the shape \(3, 1\), \(2,\) or \(2, 1\) or \(2, 13\) expected"),
        ({"noise": np.zeros((SAMPLES, RUNS + 1))}, r"`noise` has the shape \(40, 14\)"),
        ({"table": np.zeros((4, 2))}, r"`table` has the shape \(4, 2\), \(4,\) or \(4, 1\) or \(4, 13\) expected"),
    ],
    ids=str,
)
def test_columns_of_another_shape_are_refused(code, columns, words):
    sizes = {"start": 2, "noise": SAMPLES, "table": Array.TABLE}
    recorded = plan(lambda start, **_: code((*start, 1.0)), **sizes)
    right = {**given(), "table": [1.0, 2.0]}
    with pytest.raises(ValueError, match=words):
        recorded.run(RUNS, **right | columns)
