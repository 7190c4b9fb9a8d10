"""Of a kernel with some of its outputs only what these need is left, and that gives the same bits."""

from __future__ import annotations

import random
from typing import Annotated, Any, NamedTuple

import pytest
from kernel_cases import input_sequence, kernel, kernel_modules, parameters

from gapsense.embedded.design import prune_graphs
from gapsense.kernels.emit import C, Graph, Python, namespace
from gapsense.kernels.kernel import trace
from gapsense.kernels.layout import Array, Memory, flat, names, zeros
from gapsense.kernels.trace import load, loop, store

LENGTH = 20


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


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.slow)], ids=["one", "more"])
@pytest.mark.parametrize("name", kernel_modules())
def test_any_choice_of_outputs_has_the_bits_of_all(name: str, seeds: range) -> None:
    k = kernel(name)
    for seed in seeds:
        rng = random.Random(f"{name} {seed}")
        every = names(k.module.Outputs)
        chosen = set(rng.sample(every, rng.randrange(1, len(every))))
        space = compiled(*prune_graphs(*k.graphs, chosen, Python))
        par = parameters(name, rng)
        inputs = [*input_sequence(name, rng, LENGTH, degenerate=False)]
        state, outputs = k.scalar["initial"](flat(inputs[0]), flat(par))
        few, found = space["initial"](inputs[0], par)
        for given in inputs[1:]:
            assert found == tuple(value for n, value in zip(every, outputs) if n in chosen)
            state, outputs = k.scalar["step"](state, flat(given), flat(par))
            few, found = space["step"](few, given, par)


def compiled(initial: Graph, step: Graph, kept: dict[str, list[str]]) -> dict[str, Any]:
    """The functions as Python on records that hold more than they need."""
    space = namespace(Python.module(Python(initial).source(), Python(step).source()), "needed")

    def few(record: Any, name: str) -> tuple[Any, ...]:
        values = dict(zip(names(type(record)), flat(record)))
        return tuple(values[entry] for entry in kept[name])

    return {
        "initial": lambda inputs, par: space["initial"](few(inputs, "inputs"), few(par, "par")),
        "step": lambda state, inputs, par: space["step"](state, few(inputs, "inputs"), few(par, "par")),
    }
