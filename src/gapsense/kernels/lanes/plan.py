"""Many calls over runs that are done in one go: in C a few runs at once, without a compiler one by one in Python."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from enum import Enum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.kernels.emit.lanes import is_array
from gapsense.kernels.lanes.code import NUMBERS, WHOLE, Code, Record, Value
from gapsense.kernels.lanes.library import HERE, address, addresses, load_library, with_types
from gapsense.kernels.layout import ARRAYS

TAKE, KEEP, OWN = 0, 1, 2  # functions: a number from a column, a number into a column, the first one that is recorded
KEPT = "kept"  # the column of results
NOWHERE = 0  # place of what nobody needs
Step = tuple[int, list[int]]  # a function and its places
Floats = npt.NDArray[np.float64]


class Column(ctypes.Structure):
    """An array (numbers, runs), as lanes.h has it."""

    _fields_ = [("address", ctypes.c_void_p), *((name, ctypes.c_ssize_t) for name in ("row", "run", "size"))]


def columns_in_c(arrays: Sequence[Floats]) -> ctypes.Array[Column]:
    """Arrays (numbers, runs) as C takes them; all runs share those of the shape (numbers,) or (numbers, 1).

    `ctypes.data` would take twice as long, and to broadcast what is shared ten times.
    """
    kind = Column * len(arrays)
    return kind(*(Column(a.__array_interface__["data"][0], *_strides(a), len(a)) for a in arrays))


def _strides(array: Floats) -> tuple[int, int]:
    return array.strides[0], array.strides[1] if array.ndim > 1 and array.shape[1] > 1 else 0


class Array(Enum):
    """Columns that functions take as a whole."""

    TABLE = "table"  # the same for all runs, or one for each


class Plan:
    """Recorded calls, the columns that they need by name and size, and what to keep of their results."""

    def __init__(
        self, record: Record, given: Mapping[str, int | Array], kept: Sequence[Value], made: Program | None = None
    ) -> None:
        self.record, self.given, self.kept = record, given, kept
        self.program = made or program(record, [*given], kept)
        self.numbers = np.array([*map(float, record.numbers)])

    @cached_property
    def library(self) -> ctypes.CDLL | None:
        """What calls the compiled functions; None if Python has to do."""
        caller = load_library(with_types((HERE / "run.c").read_text(encoding="utf-8")))
        return caller if caller and self._addresses is not None else None

    @cached_property
    def _addresses(self) -> list[int] | None:
        return addresses(self.program.codes)

    @cached_property
    def _called(self) -> tuple[ctypes.Array[ctypes.c_void_p], ctypes.Array[ctypes.c_void_p]]:
        """Addresses of all functions, and of the constants of each."""
        constants = [code.c.constants.ctypes.data for code in self.program.codes]
        own = [address(self.library, name) for name in ("take", "keep")] if self.library else []
        kind = ctypes.c_void_p * (OWN + len(constants))
        return kind(*own, *(self._addresses or ())), kind(*[None] * OWN, *constants)

    @cached_property
    def _tables(self) -> dict[str, Floats]:
        return {name: np.array(table, float) for name, table in self.record.tables.items()}

    @cached_property
    def _words(self) -> npt.NDArray[np.int32]:
        return np.array(self.program.words(), np.int32)

    def run(self, runs: int, /, **given: Any) -> Floats:
        """What is kept, (values, runs).

        Each column is an array (numbers, runs), or (numbers,) if it is the same for all runs.
        """
        arrays = self._columns(runs, given)
        if self.library:
            self._in_c(self.library, runs, arrays)
        else:
            whole = (array[:, None] if array.ndim == 1 else array for array in arrays[:-1])
            every = [np.broadcast_to(array, (len(array), runs)) for array in whole]
            for run in range(runs):
                self._in_python([array[:, run].tolist() for array in every], arrays[-1][:, run])
        return arrays[-1]

    def _columns(self, runs: int, given: Mapping[str, Any]) -> list[Floats]:
        if given.keys() != self.given.keys():
            raise ValueError(f"columns {', '.join(given)} found, {', '.join(self.given)} expected. Correct them.")
        made = {name: _check_column(name, self.given[name], value, runs) for name, value in given.items()}
        made |= {NUMBERS: self.numbers, **self._tables}
        made |= {name: np.zeros((size, runs)) for name, size in self.record.memories.items()}
        made[KEPT] = np.full((len(self.kept), runs), np.nan)
        return [made[name] for name in self.program.columns]

    def _in_c(self, library: ctypes.CDLL, runs: int, arrays: list[Floats]) -> None:
        words, (functions, numbers) = self._words, self._called
        columns = columns_in_c(arrays)
        memory = np.empty(library.width() * (self.program.room + 1))
        places = [ctypes.c_void_p(array.ctypes.data) for array in (words, memory)]
        first, last, length = map(ctypes.c_ssize_t, (0, runs, words.size))
        library.run(places[0], length, columns, functions, numbers, places[1], first, last)

    def _in_python(self, columns: list[list[float]], kept: Floats) -> None:
        """One run; after an error of Python, where C goes on with infinity or NaN, what would be kept is NaN."""
        values: list[Any] = [None] * self.program.room
        with suppress(ArithmeticError, ValueError):
            for function, at in self.program.steps:
                if function == TAKE:
                    values[at[2]] = columns[at[0]][at[1]]
                elif function == KEEP:
                    kept[at[1]] = values[at[2]]
                else:
                    _call(self.program.codes[function - OWN], at, values, columns)


def plan(function: Callable[..., Sequence[Any]], /, **given: int | Array) -> Plan:
    """The plan of a function of columns, which it gets by name as rows of values, and which returns a row to keep.

    Parameters
    ----------
    function : callable
        Calls `Code` with what it gets.
    **given : int or Array
        Names of the columns, and how many numbers each has for a run, or what kind of array it is: a single value.
    """
    record = Record()
    kept = function(**{name: _values(record, name, size) for name, size in given.items()})
    return Plan(record, given, [record.value(entry) for entry in kept])


def _values(record: Record, name: str, size: int | Array) -> Any:
    """What stands for a column: a row, or a single value."""
    if isinstance(size, Array):
        return Value(record, name, WHOLE)
    return tuple(Value(record, name, row) for row in range(size))


def _check_column(name: str, size: int | Array, value: Any, runs: int) -> Any:
    """A column of the right shape."""
    is_ready = isinstance(value, np.ndarray) and value.dtype == np.float64 and value.ndim
    array: Any = value if is_ready else np.atleast_1d(np.asarray(value, float))
    n = len(array) if isinstance(size, Array) else size
    shapes = [(n,), (n, 1), (n, runs)]
    if array.shape not in shapes:
        expected = " or ".join(map(str, shapes))
        raise ValueError(f"column `{name}` has the shape {array.shape}, {expected} expected. Correct it.")
    return array


def _call(code: Code, at: Sequence[int], values: list[Any], columns: list[list[float]]) -> None:
    """Do a recorded call for one run."""
    rest = iter([(columns if s.extra in ARRAYS else values)[place] for s, place in zip(code.symbols, at)])
    made = code.python(*([next(rest) for _ in range(size)] for size in code.sizes))
    results = zip(made if len(code.graph.results) > 1 else (made,), code.graph.results)
    numbers = (value for row, (_, entries) in results for value, e in zip(row, entries) if not is_array(e))
    for place, value in zip(at[len(code.symbols) :], numbers):
        values[place] = value


# Recorded calls as numbers: the function, and the places of its arguments and results.
#
# Values that are not needed at the same time share a place: what is computed for a few runs then fits into the cache.


class Program(NamedTuple):
    """All steps, with columns and functions by their places in these lists."""

    steps: list[Step]
    columns: list[str]
    codes: list[Code]
    room: int  # places that there are

    def words(self) -> list[int]:
        """The steps in a row, as run.c reads them."""
        return [word for function, places in self.steps for word in (function, len(places), *places)]


def program(record: Record, given: Sequence[str], kept: Sequence[Value]) -> Program:
    """The program of recorded calls, for the columns that are given and the values to keep."""
    columns = columns_with(record, given)
    codes = list(dict.fromkeys(call.code for call in record.calls))
    writer = _ReusedPlaces(record, kept, columns, codes)
    return Program([*writer.steps()], columns, codes, writer.room)


def columns_with(record: Record, given: Iterable[str]) -> list[str]:
    """Names of all columns, in their order."""
    return [NUMBERS, *given, *record.tables, *record.memories, KEPT]


class _ReusedPlaces:
    """Goes through the calls and gives places."""

    def __init__(self, record: Record, kept: Sequence[Value], columns: list[str], codes: list[Code]) -> None:
        self.calls = record.calls
        self.columns = {name: k for k, name in enumerate(columns)}
        self.functions = {code: OWN + k for k, code in enumerate(codes)}
        self.last = {value: k for k, call in enumerate(self.calls) for value in call.taken}
        self.rows: dict[Value, list[int]] = {}
        for row, value in enumerate(kept):
            self.rows.setdefault(value, []).append(row)
        self.places: dict[Value, int] = {}
        self.free: list[int] = []
        self.room = NOWHERE + 1

    def steps(self) -> Iterator[Step]:
        """All steps: what is given is taken before its first use, and results are kept as soon as they are made."""
        for k, call in enumerate(self.calls):
            for value in call.taken:
                yield from self._take(value)
            taken = [self._place(value) for value in call.taken]
            self._release(value for value in dict.fromkeys(call.taken) if self.last[value] == k)
            yield self.functions[call.code], [*taken, *map(self._new, call.made)]
            for value in call.made:
                yield from self._keep(value)
        for value in [value for value in self.rows if value.column]:  # given, and kept as it is
            yield from self._take(value)
            yield from self._keep(value)

    def _take(self, value: Value) -> Iterator[Step]:
        if value.column and value.row != WHOLE and value not in self.places:
            yield TAKE, [self.columns[value.column], value.row, self._new(value)]

    def _keep(self, value: Value) -> Iterator[Step]:
        for row in self.rows.get(value, []):
            yield KEEP, [self.columns[KEPT], row, self.places[value]]
        if value not in self.last:
            self._release([value])

    def _place(self, value: Value) -> int:
        return self.columns[value.column] if value.row == WHOLE else self.places[value]

    def _new(self, value: Value) -> int:
        if not (value.column or value in self.last or value in self.rows):
            return NOWHERE
        if not self.free:
            self.free.append(self.room)
            self.room += 1
        self.places[value] = self.free.pop()
        return self.places[value]

    def _release(self, values: Iterable[Value]) -> None:
        self.free += [self.places.pop(value) for value in values if value in self.places]
