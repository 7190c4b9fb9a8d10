"""Recorded calls as numbers: which function, and the places of what it takes and makes.

Values that are not needed at the same time share a place: what is computed for a few runs then fits into the cache.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from gapsense.kernels.lanes.code import NUMBERS, WHOLE, Code, Record, Value

TAKE, KEEP, OWN = 0, 1, 2  # functions: a number from a column, a number into a column, the first one that is recorded
KEPT = "kept"  # the column of results
NOWHERE = 0  # place of what nobody needs
Step = tuple[int, list[int]]  # a function and its places


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
    columns = [NUMBERS, *given, *record.tables, *record.memories, KEPT]
    codes = list(dict.fromkeys(call.code for call in record.calls))
    writer = _Writer(record, kept, columns, codes)
    return Program([*writer.steps()], columns, codes, writer.room)


class _Writer:
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
                yield from self._taken(value)
            taken = [self._place(value) for value in call.taken]
            self._release(value for value in dict.fromkeys(call.taken) if self.last[value] == k)
            yield self.functions[call.code], [*taken, *map(self._new, call.made)]
            for value in call.made:
                yield from self._kept(value)
        for value in [value for value in self.rows if value.column]:  # given, and kept as it is
            yield from self._taken(value)
            yield from self._kept(value)

    def _taken(self, value: Value) -> Iterator[Step]:
        if value.column and value.row != WHOLE and value not in self.places:
            yield TAKE, [self.columns[value.column], value.row, self._new(value)]

    def _kept(self, value: Value) -> Iterator[Step]:
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
