"""A function on flat rows over runs, and the record of calls of such functions.

A row has an entry for each number of a record. An entry has a number for each run, or one for all of them.

A `Code` computes plain numbers, of a single run, in scalar Python. The values of a `Record` stand for numbers of runs
that come later: the call is recorded. The plain Python around it runs now and never again, with its loops over samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from gapsense.kernels.emit import Graph, Lanes, compile_graph
from gapsense.kernels.emit.c import held

Row: TypeAlias = tuple[Any, ...]
# Of a result: the argument that it is, as array memory and tables stay where they are; zeros of new memory; or a call.
Origin: TypeAlias = "int | list[float] | None"
NUMBERS = "numbers"  # the column of plain numbers, the same for all runs
WHOLE = -1  # in place of a row: all numbers of a column, which are array memory or a table


class InC(NamedTuple):
    """Text of a function, and the numbers that it is given as `k`."""

    text: str
    constants: npt.NDArray[np.float64]


class Value:
    """A number of each run: row `row` of a column that is given, or else what a call makes."""

    __slots__ = ("column", "record", "row")

    def __init__(self, record: Record, column: str = "", row: int = 0) -> None:
        self.record, self.column, self.row = record, column, row


class Call(NamedTuple):
    """A function, its arguments, and its results."""

    code: Code
    taken: list[Value]
    made: list[Value]


class Record:
    """Calls in their order, and the columns that they need besides those that are given."""

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.numbers: dict[str, Value] = {}  # by their text, which tells zeros of both signs apart
        self.tables: dict[str, list[float]] = {}
        self.memories: dict[str, int] = {}  # how many numbers each has

    def value(self, entry: Any) -> Value:
        """The value of an entry of a row: one of this record, a plain number, or a table."""
        if isinstance(entry, Value):
            return entry
        if isinstance(entry, list):
            self.tables[name := f"table {len(self.tables)}"] = entry
            return Value(self, name, WHOLE)
        return self.numbers.setdefault(repr(float(entry)), Value(self, NUMBERS, len(self.numbers)))

    def memory(self, size: int) -> Value:
        """Array memory of zeros that begins with a call."""
        self.memories[name := f"memory {len(self.memories)}"] = size
        return Value(self, name, WHOLE)


class Code:
    """A traced function; its results are a row, or a tuple of rows if it returns several records."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.sizes = [len(symbols) for _, _, symbols in graph.arguments]
        self.symbols = [symbol for _, _, symbols in graph.arguments for symbol in symbols]

    @cached_property
    def python(self) -> Callable[..., Any]:
        """The same as scalar Python, for a single run."""
        return compile_graph(self.graph)

    @cached_property
    def c(self) -> InC:
        """The same as C, of the function `NAME`."""
        printer = Lanes(self.graph._replace(name="NAME"))
        return InC(printer.source(), np.array([*printer.constants.values()], float))

    def __call__(self, *rows: Any) -> Any:
        """The results for some rows."""
        entries = [entry for row in rows for entry in row]
        record = next((entry.record for entry in entries if isinstance(entry, Value)), None)
        return self._record(record, entries) if record else self.python(*rows)

    def _record(self, record: Record, entries: Sequence[Any]) -> Any:
        taken, made = [record.value(entry) for entry in entries], list[Value]()

        def value(origin: Origin) -> Value:
            """Value of an entry of a result."""
            if isinstance(origin, list):
                return record.memory(len(origin))
            if origin is not None:
                return taken[origin]
            made.append(Value(record))
            return made[-1]

        results = [tuple(map(value, row)) for row in self._origins]
        record.calls.append(Call(self, taken, made))
        return results[0] if len(results) == 1 else tuple(results)

    @cached_property
    def _origins(self) -> list[list[Origin]]:
        """Of each entry of the results."""
        at = {symbol.id: k for k, symbol in enumerate(self.symbols)}

        def origin(entry: Any) -> Origin:
            array = None if isinstance(entry, list) else held(entry)
            return entry if isinstance(entry, list) else None if array is None else at[array.id]

        return [[origin(entry) for entry in row] for _, row in self.graph.results]
