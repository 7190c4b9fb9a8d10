"""What a step needs of the parameters alone is computed apart from it, and nothing that could fail too early."""

from __future__ import annotations

from typing import Any, NamedTuple

from gapsense.kernels.emit import Graph, Python, split
from gapsense.kernels.kernel import STEP, trace
from gapsense.kernels.trace import cond, where


class Parameters(NamedTuple):
    unused: Any
    gain: Any
    width: Any


class Inputs(NamedTuple):
    x: Any


class Outputs(NamedTuple):
    y: Any


def graph(function: Any) -> Graph:
    def step(state: Inputs, inputs: Inputs, par: Parameters) -> Any:
        return state, Outputs(function(inputs.x, par.gain, par.width))

    return trace(step, {"state": Inputs, "inputs": Inputs, "par": Parameters})


def parts(function: Any) -> dict[str, Any]:
    space: dict[str, Any] = {}
    text = Python.module(*(Python(g).source() for g in split(graph(function), Python)), STEP)
    exec(text, space)
    return space


def test_constants_are_parameters_that_the_rest_needs_and_what_follows_from_parameters() -> None:
    made = parts(lambda x, gain, width: where(gain * width > 2.0, x * gain, x))
    assert made["constants"]((1.0, 2.0, 3.0)) == (2.0, True)
    assert made["advance"]((0.0,), (5.0,), (2.0, True)) == ((0.0,), (10.0,))
    assert made["step"]((0.0,), (5.0,), (1.0, 2.0, 3.0)) == ((0.0,), (10.0,))


def test_a_division_in_a_branch_stays_there_but_a_product_does_not() -> None:
    def function(x: Any, gain: Any, width: Any) -> Any:
        return cond(x > 0.0, lambda: x * (gain / width), lambda: x * (gain * width))

    made = parts(function)
    constants = made["constants"]((0.0, 3.0, 0.0))
    assert constants == (3.0, 0.0, 0.0)
    assert made["advance"]((0.0,), (-1.0,), constants) == ((0.0,), (-0.0,))
    assert made["advance"]((0.0,), (2.0,), made["constants"]((0.0, 3.0, 4.0)))[1] == (1.5,)


def test_a_result_that_is_a_constant() -> None:
    made = parts(lambda x, gain, width: gain + width)
    assert made["constants"]((0.0, 1.0, 2.0)) == (3.0,)
    assert made["advance"]((7.0,), (0.0,), (3.0,)) == ((7.0,), (3.0,))


def test_without_parameters() -> None:
    made = parts(lambda x, gain, width: x)
    assert made["constants"]((0.0, 1.0, 2.0)) == ()
    assert made["step"]((7.0,), (4.0,), (0.0, 1.0, 2.0)) == ((7.0,), (4.0,))


def test_a_branch_on_parameters_alone_is_taken_once_with_all_that_is_in_it() -> None:
    def function(x: Any, gain: Any, width: Any) -> Any:
        ratio = cond(width > 0.0, lambda: gain / width, lambda: gain)
        return cond(x > 0.0, lambda: x * ratio, lambda: cond(width > 0.0, lambda: x / width, lambda: x))

    made = parts(function)
    assert made["constants"]((0.0, 3.0, 0.0)) == (0.0, False, 3.0)
    constants = made["constants"]((0.0, 3.0, 4.0))
    assert 0.75 in constants
    assert made["advance"]((0.0,), (2.0,), constants)[1] == (1.5,)
    assert made["advance"]((0.0,), (-2.0,), constants)[1] == (-0.5,)
