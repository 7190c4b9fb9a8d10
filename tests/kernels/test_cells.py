"""A step in C changes the state in place, and never what is still needed: its bits are those of Python."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest
from c_code import build

from gapsense.kernels.emit import C, Graph, Python, c, namespace
from gapsense.kernels.kernel import trace
from gapsense.kernels.trace import cond, where

PROGRAMS, ROWS = 60, 40


class State(NamedTuple):
    p: Any
    q: Any
    r: Any
    s: Any


class Inputs(NamedTuple):
    x: Any


class Outputs(NamedTuple):
    y: Any


def traced(step: Callable[..., Any]) -> Graph:
    return trace(step, {"state": State, "inputs": Inputs})


def drawn(seed: int) -> Graph:
    """A step of random exchanges, sums and branches."""

    def mixed(values: list[Any], rng: Random, depth: int) -> list[Any]:
        for _ in range(rng.randint(1, 4)):
            i, j, k = (rng.randrange(len(values)) for _ in range(3))
            kind = rng.choice(["exchange", "sum", "choice", *["branch"] * (2 * (depth < 3))])
            if kind == "exchange":
                values[i], values[j] = values[j], values[i]
            elif kind == "sum":
                values[i] = values[j] * rng.choice([0.5, -0.75, 1.0]) + values[k]
            elif kind == "choice":
                values[i] = where(values[j] < values[k], values[j], values[i])
            else:
                values = branched(values, values[i] > values[j], rng.random(), depth)
        return values

    def branched(values: list[Any], is_so: Any, seed: float, depth: int) -> list[Any]:
        yes, no = (lambda n=n: mixed([*values], Random(f"{seed} {n}"), depth + 1) for n in range(2))
        return cond(is_so, yes, no if seed < 0.7 else lambda: values)

    def step(state: State, inputs: Inputs) -> tuple[State, Outputs]:
        *new, y = mixed([*state, inputs.x], Random(seed), 0)
        return State(*new), Outputs(y)

    return traced(step)


@pytest.mark.parametrize("few", [0, c.FEW], ids=["in place", "in registers"])
def test_steps_give_the_bits_of_python(few: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c, "FEW", few)
    graphs = [drawn(seed) for seed in range(PROGRAMS)]
    texts = [C(g._replace(name=f"step_{k}")).source() for k, g in enumerate(graphs)]
    library, rng = build(C.module(*texts), tmp_path), Random(1)
    for k, g in enumerate(graphs):
        function = namespace(Python.module(Python(g).source()), "drawn")["step"]
        there, y = (ctypes.c_double * 4)(1.0, -2.0, 3.0, 0.5), (ctypes.c_double * 1)()
        here = tuple(there)
        for _ in range(ROWS):
            x = (rng.uniform(-3.0, 3.0),)
            here, outputs = function(tuple(max(-9.0, min(9.0, v)) for v in here), x)
            there[:] = [max(-9.0, min(9.0, v)) for v in there]
            getattr(library, f"step_{k}")(there, None, (ctypes.c_double * 1)(*x), None, None, None, y)
            assert (tuple(there), y[0]) == (here, outputs[0]), texts[k]


def test_what_stays_is_not_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c, "FEW", 0)

    def step(state: State, inputs: Inputs) -> tuple[State, Outputs]:
        new = cond(inputs.x > 0.0, lambda: state._replace(p=inputs.x, q=state.q + 1.0), lambda: state)
        return new, Outputs(new.p)

    lines = [line.strip() for line in C(traced(step)).source().splitlines()[4:-1]]
    assert lines == [
        "if (inputs[0] > R(0.0)) {",
        "state[0] = inputs[0];",
        "state[1] = state[1] + R(1.0);",
        "}",
        "outputs[0] = state[0];",
    ]


def test_what_is_needed_later_is_not_overwritten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c, "FEW", 0)

    def step(state: State, inputs: Inputs) -> tuple[State, Outputs]:
        new = cond(inputs.x > 0.0, lambda: state._replace(p=inputs.x), lambda: state)
        return new, Outputs(new.p - state.p)

    text = C(traced(step)).source()
    assert text.index("outputs[0] =") < text.index("state[0] =")
