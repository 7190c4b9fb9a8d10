"""Of a kernel with some of its outputs only what these need is left, and that gives the same bits."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import pytest

from gapsense.embedded.design import prune_graphs
from gapsense.kernels.emit import C, Graph, Python
from gapsense.kernels.kernel import trace
from gapsense.kernels.layout import Array, Memory, zeros
from gapsense.kernels.trace import load, loop, store


class Parameters(NamedTuple):
    gain: Any
    unused: Any


class Inputs(NamedTuple):
    x: Any
    y: Any


class State(NamedTuple):
    sum: Any
    alone: Any  # only ever read for its own next value
    count: Any
    ring: Annotated[Array, Memory(3)]


class Outputs(NamedTuple):
    total: Any
    before: Any
    last: Any


def graphs() -> tuple[Graph, Graph]:
    def initial(inputs: Inputs, par: Parameters) -> Any:
        return State(inputs.x, 1.0, 0.0, zeros(3)), Outputs(inputs.x, 0.0, inputs.y)

    def step(state: State, inputs: Inputs, par: Parameters) -> Any:
        ring = store(state.ring, 0.0, inputs.y)
        total = state.sum + par.gain * inputs.x
        after = State(total, state.alone * 2.0, state.count + 1.0, ring)
        return after, Outputs(total, load(ring, 0.0) + state.count, inputs.y)

    return (
        trace(initial, {"inputs": Inputs, "par": Parameters}),
        trace(step, {"state": State, "inputs": Inputs, "par": Parameters}),
    )


@pytest.mark.parametrize(
    "outputs, state, inputs, par",
    [
        (["total"], ["sum"], ["x"], ["gain"]),
        (["before"], ["count", "ring"], ["y"], []),
        (["last"], [], ["y"], []),
        (["last", "total"], ["sum"], ["x", "y"], ["gain"]),
    ],
)
def test_only_what_an_output_depends_on_today_or_later_is_kept(
    outputs: list[str], state: list[str], inputs: list[str], par: list[str]
) -> None:
    *_, kept = prune_graphs(*graphs(), outputs, Python)
    assert [{*kept[name]} for name in ("state", "inputs", "par")] == [{*state}, {*inputs}, {*par}]


def test_what_no_round_of_a_loop_needs_is_not_computed() -> None:
    def step(inputs: Inputs) -> Any:
        y, _ = loop(5, lambda a, b: ((a * inputs.x, b + inputs.y), a > 9.0), (1.0, 2.0))
        return Outputs(y, y, y)

    graph = trace(step, {"inputs": Inputs})
    assert "inputs_y" not in Python(graph).source()
    assert "inputs_y" not in C(graph._replace(results=[(Outputs, []), graph.results[0]])).source()
