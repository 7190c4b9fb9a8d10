"""A function of scalars, traced and compiled in all the ways there are."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from c_code import build_graph

from gapsense.kernels.emit import Graph, Python, namespace
from gapsense.kernels.kernel import trace
from gapsense.kernels.layout import Array, Memory, Table, names


class Inputs(NamedTuple):
    a: Any
    b: Any
    c: Any


class State(NamedTuple):
    memory: Annotated[Array, Memory(5)]


class Parameters(NamedTuple):
    table: Annotated[Array, Table()]


class Outputs(NamedTuple):
    y: Any


class Pair(NamedTuple):
    y: Any
    z: Any


def graph(function: Callable[..., Any], outputs: type = Outputs) -> Graph:
    """Graph of a function of three scalars that returns a scalar, or a tuple of them for another record."""

    def step(inputs: Inputs) -> Any:
        result = function(*inputs)
        return outputs(*result) if isinstance(result, tuple) else outputs(result)

    return trace(step, {"inputs": Inputs})


def python_text(function: Callable[..., Any], outputs: type = Outputs) -> str:
    return Python(graph(function, outputs)).source()


def compiled(text: str) -> Callable[..., Any]:
    return namespace(Python.module(text), "traced")["step"]


def run_python(function: Callable[..., Any], *values: float, outputs: type = Outputs) -> Any:
    result = compiled(python_text(function, outputs))(values)
    return result[0] if isinstance(result, tuple) and outputs is Outputs else result


def run_c(function: Callable[..., Any], folder: Path, *values: float, outputs: type = Outputs) -> Any:
    g = graph(function, outputs)
    library = build_graph(g, folder)
    given, found = (ctypes.c_double * 3)(*values), (ctypes.c_double * len(names(outputs)))()
    none = ctypes.c_void_p(None)
    library.step(none, none, given, none, none, none, found)
    return found[0] if outputs is Outputs else tuple(found)


def memory_step(g: Graph, folder: Path) -> Callable[[list[float], Inputs], float]:
    """A step with the memory of `State` in C; it changes the memory that it is given."""
    library = build_graph(g, folder)

    def step(memory: list[float], inputs: Inputs) -> float:
        own, given, found = (ctypes.c_double * 5)(*memory), (ctypes.c_double * 3)(*inputs), (ctypes.c_double * 1)()
        addresses, none = (ctypes.c_void_p * 1)(ctypes.addressof(own)), ctypes.c_void_p(None)
        library.step(none, addresses, given, none, none, none, found)
        memory[:] = own
        return found[0]

    return step
