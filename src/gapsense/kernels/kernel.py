"""A kernel: the pure functions `initial` and `step` of a component on its records, and the code made from them.

A kernel module defines named tuples `Parameters`, `State`, `Inputs`, `Outputs` (see `records`) and

    initial(inputs, par) -> (State, Outputs)         the state at the start, and the outputs at that instant
    step(state, inputs, par) -> (State, Outputs)     one step; outputs are valid at its end
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, NamedTuple

from gapsense.kernels.emit import HARMLESS_IN_C, C, Graph, Python, indexing, namespace, split
from gapsense.kernels.emit.c import held
from gapsense.kernels.layout import Choice, fields, flat, leaves, names, record, zeros
from gapsense.kernels.trace import Expr, Tape, TraceError, memory_of

STEP = """def step(state, inputs, par):
    return advance(state, inputs, constants(par))
"""
STEP_IN_C = """void {name}_step(real *state, real *const *memory, const real *inputs, const real *par,
    const real *const *tables, const int *table_sizes, real *outputs)
{{
    real constants[{count} + 1]; /* there may be none */
    {name}_constants(NULL, NULL, NULL, par, tables, table_sizes, constants);
    {name}_advance(state, memory, inputs, constants, tables, table_sizes, outputs);
}}
"""


def trace(
    function: Callable[..., Any], arguments: Mapping[str, type], returns: Sequence[type] = (), with_places: bool = False
) -> Graph:
    """Graph of `function`, called with one symbolic record per argument; it returns a record or a tuple of records."""
    tape = Tape({} if with_places else None)
    symbols = {name: _symbols(tape, cls) for name, cls in arguments.items()}
    result = function(**{name: record(cls, symbols[name]) for name, cls in arguments.items()})
    results = result if type(result) is tuple else (result,)
    _check_classes(function, [*map(type, results)], [*returns])
    for item in results:
        _check_memory(function.__name__, item)
    return Graph(
        function.__name__,
        tape,
        [(n, cls, symbols[n]) for n, cls in arguments.items()],
        [(type(r), [float(x) if isinstance(x, Choice) else x for x in flat(r)]) for r in results],
    )


def _symbols(tape: Tape, cls: type) -> list[Expr]:
    kinds = {name: field.kind for name, field in fields(cls).items()}
    return [tape.node("in", (), kinds.get(entry, "scalar")) for entry in names(cls)]


def _check_classes(function: Callable[..., Any], found: list[type], expected: list[type]) -> None:
    """What a function returns are records, those expected if any are."""
    if (found != expected) if expected else not all(hasattr(cls, "_fields") for cls in found):
        line = f"{function.__code__.co_filename}:{function.__code__.co_firstlineno}, in {function.__name__}"
        have, want = (", ".join(cls.__name__ for cls in classes) for classes in (found, expected))
        raise TraceError(f"{line}: it returns {have}; expected {want or 'records'}. Correct what it returns.")


def _check_memory(name: str, result: Any) -> None:
    """Array memory starts as zeros, and stays in its field."""
    for entry, field, item in leaves(result):
        if field.kind != "memory" or isinstance(item, Expr):
            continue
        if any(isinstance(value, Expr) for value in item) or item != zeros(field.size):
            raise TraceError(f"`{name}`: array memory `{entry}` must start as zeros({field.size}).")
    memory = [root for _, _, item in leaves(result) if (root := memory_of(item)) is not None]
    if [root.id for root in memory] != sorted({root.id for root in memory}):
        raise TraceError(f"`{name}`: array memory must be returned in the field that it came from.")


class Wholes(NamedTuple):
    """Whole numbers of a state, of which indices are made: `first` of an entry, and each `every` after it in memory."""

    entry: int
    first: int
    every: int
    least: int
    most: int


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
        return self.trace()

    @cached_property
    def wholes(self) -> list[Wholes]:
        """What a saved state must hold, for all indices to be right ones.

        Raises
        ------
        TraceError
            If indices are made of an entry of the state that does not say what it may be.
        """
        layout = fields(self.module.State)
        spans = {name: field.spans for name, field in layout.items() if any(field.spans)}
        for name in sorted(indexing(self.graphs[1]) - spans.keys()):
            raise TraceError(
                f"`{self.name}`: indices are made of `{name}` of the state. Say what it may be: `Whole(0, n)`."
            )
        entries = {name: k for k, name in enumerate(names(self.module.State))}
        found = ((entries[name], k, len(own), span) for name, own in spans.items() for k, span in enumerate(own))
        return [Wholes(entry, k, every, *span) for entry, k, every, span in found if span]

    def trace(self, values: Mapping[str, Any] | None = None, with_places: bool = False) -> tuple[Graph, Graph]:
        """Traced `initial` and `step`; parameters that have `values` are numbers in them, but for tables.

        On request the graphs know the line that each operation comes from.
        """
        m = self.module
        given, made = {"inputs": m.Inputs, "par": m.Parameters}, (m.State, m.Outputs)
        initial, step = (_with(f, values) if values else f for f in (m.initial, m.step))
        return trace(initial, given, made, with_places), trace(step, {"state": m.State, **given}, made, with_places)

    def python(self) -> str:
        """Source of a stdlib-only module with `initial(inputs, par)` and `step(state, inputs, par)` on flat tuples.

        `step` is `advance(state, inputs, constants(par))`: who steps often computes the constants once.
        """
        initial, step = self.graphs
        functions = [Python(g).source() for g in (initial, *split(step, Python))]
        return f"# {self._origin}\n{Python.module(*functions, STEP)}"

    @cached_property
    def in_c(self) -> tuple[Graph, Graph]:
        """`constants`, which may be computed once as in Python, and `advance`."""
        return split(self.graphs[1], C, HARMLESS_IN_C)

    @property
    def constant_count(self) -> int:
        """Numbers that `constants` makes in C."""
        ((_, entries),) = self.in_c[0].results
        return sum(held(entry) is None for entry in entries)

    def c(self) -> str:
        """C99 source of `<name>_initial`, `_constants`, `_advance` and `_step`, as those of Python."""
        tables = [name for name, field in fields(self.module.Parameters).items() if field.kind == "table"]
        graphs = (self.graphs[0], *self.in_c)
        functions = [C(g._replace(name=f"{self.name}_{g.name}"), tables).source() for g in graphs]
        step = STEP_IN_C.format(name=self.name, count=self.constant_count)
        return f"/* {self._origin} */\n{C.module(*functions, step)}"

    @property
    def _origin(self) -> str:
        return f"Kernel `{self.name}`, generated from {self.module.__name__} by gapsense.kernels.emit; do not edit."

    @cached_property
    def scalar(self) -> Mapping[str, Any]:
        """Namespace of the compiled scalar Python."""
        return namespace(self.python(), self.name)

    def initial(self, inputs: Any, par: Any) -> tuple[Any, Any]:
        """State and outputs at the start, as records, computed by the scalar code."""
        return self._records(self.scalar["initial"](flat(inputs), flat(par)))

    def step(self, state: Any, inputs: Any, par: Any) -> tuple[Any, Any]:
        """State and outputs after one step, as records, computed by the scalar code."""
        return self._records(self.scalar["step"](flat(state), flat(inputs), flat(par)))

    def run(self, given: Iterable[Sequence[float]], par: Any) -> tuple[Any, list[Sequence[float]]]:
        """Last state, as a record, and flat outputs of all samples, by the scalar code with constants computed once."""
        rows, entries = iter(given), flat(par)
        constants, advance = self.scalar["constants"](entries), self.scalar["advance"]
        state, outputs = self.scalar["initial"](next(rows), entries)
        found = [outputs]
        for row in rows:
            state, outputs = advance(state, row, constants)
            found.append(outputs)
        return record(self.module.State, state), found

    def _records(self, entries: tuple[Any, Any]) -> tuple[Any, Any]:
        return record(self.module.State, entries[0]), record(self.module.Outputs, entries[1])


def _with(function: Callable[..., Any], values: Mapping[str, Any]) -> Callable[..., Any]:
    """The function with numbers in place of its parameters."""

    def with_values(*, par: Any, **others: Any) -> Any:
        entries = zip(names(type(par)), flat(par))
        numbers = (entry if isinstance(values.get(name, []), list) else float(values[name]) for name, entry in entries)
        return function(**others, par=record(type(par), numbers))

    with_values.__name__ = function.__name__
    return with_values
