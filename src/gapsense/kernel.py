"""A kernel: the pure functions `initial` and `step` of a component on its records, and the code made from them.

A kernel module defines named tuples `Parameters`, `State`, `Inputs`, `Outputs` (see `records`) and

    initial(inputs, par) -> (State, Outputs)         the state at the start, and the outputs at that instant
    step(state, inputs, par) -> (State, Outputs)     one step; outputs are valid at its end
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from gapsense.emit import C, Graph, Numpy, Python
from gapsense.records import fields, flat, names, record
from gapsense.trace import Expr, Tape


def trace(function: Callable[..., Any], arguments: Mapping[str, type]) -> Graph:
    """Graph of `function`, called with one symbolic record per argument; it returns one record or a tuple of records."""
    tape = Tape()
    symbols = {name: _symbols(tape, cls) for name, cls in arguments.items()}
    result = function(**{name: record(cls, symbols[name]) for name, cls in arguments.items()})
    results = [result] if hasattr(result, "_fields") else list(result)
    return Graph(
        function.__name__,
        tape,
        [(n, cls, symbols[n]) for n, cls in arguments.items()],
        [(type(r), flat(r)) for r in results],
    )


def _symbols(tape: Tape, cls: type) -> list[Expr]:
    kinds = {name: field.kind for name, field in fields(cls).items()}
    return [tape.node("in", (), kinds.get(entry, "scalar")) for entry in names(cls)]


@dataclass(frozen=True)
class Kernel:
    """The functions and records of one kernel module."""

    module: ModuleType

    @property
    def name(self) -> str:
        """Last part of the module's name."""
        return self.module.__name__.rpartition(".")[2]

    @cached_property
    def graphs(self) -> tuple[Graph, Graph]:
        """Traced `initial` and `step`."""
        m = self.module
        return (
            trace(m.initial, {"inputs": m.Inputs, "par": m.Parameters}),
            trace(m.step, {"state": m.State, "inputs": m.Inputs, "par": m.Parameters}),
        )

    def python(self) -> str:
        """Source of a stdlib-only module with `initial(inputs, par)` and `step(state, inputs, par)` on flat tuples."""
        return "\n\n".join([Python.head, *(Python(g).source() for g in self.graphs)])

    def numpy(self) -> str:
        """Source of a numpy module with the same functions over N runs; they take one more argument, `runs`."""
        return "\n\n".join([Numpy.head, *(Numpy(g).source() for g in self.graphs)])

    def c(self) -> str:
        """C99 source of `<name>_initial` and `<name>_step`."""
        return "\n".join([C.head, *(C(g._replace(name=f"{self.name}_{g.name}")).source() for g in self.graphs)])

    @cached_property
    def scalar(self) -> Mapping[str, Any]:
        """Namespace of the compiled scalar Python."""
        return _compiled(self.python(), f"<{self.name}>")

    @cached_property
    def batch(self) -> Mapping[str, Any]:
        """Namespace of the compiled numpy code."""
        return _compiled(self.numpy(), f"<{self.name} over runs>")

    def initial(self, inputs: Any, par: Any) -> tuple[Any, Any]:
        """State and outputs at the start, as records, computed by the scalar code."""
        return self._records(self.scalar["initial"](flat(inputs), flat(par)))

    def step(self, state: Any, inputs: Any, par: Any) -> tuple[Any, Any]:
        """State and outputs after one step, as records, computed by the scalar code."""
        return self._records(self.scalar["step"](flat(state), flat(inputs), flat(par)))

    def _records(self, entries: tuple[Any, Any]) -> tuple[Any, Any]:
        return record(self.module.State, entries[0]), record(self.module.Outputs, entries[1])

    def step_batch(self, state: Any, inputs: Any, par: Any, runs: int) -> tuple[Any, Any]:
        """Flat state and outputs of `runs` runs, arrays (runs,) or scalars that hold for all of them."""
        with np.errstate(all="ignore"):  # both branches of a condition are computed, and one may be meaningless
            return self.batch["step"](state, inputs, par, runs)  # type: ignore[no-any-return]

    def initial_batch(self, inputs: Any, par: Any, runs: int) -> tuple[Any, Any]:
        """As `step_batch`, at the start."""
        with np.errstate(all="ignore"):
            return self.batch["initial"](inputs, par, runs)  # type: ignore[no-any-return]


def _compiled(source: str, name: str) -> dict[str, Any]:
    space: dict[str, Any] = {}
    exec(compile(source, name, "exec"), space)
    return space
