"""What is run: every combination of the blocks of a study, found by its number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim.scenario.records import Port, Scenario, telling
from gapsense.tables import Value

FEW = 1000  # values of a block that are all looked at, and points


class Block(NamedTuple):
    """Values that belong together: a column for each parameter."""

    columns: Mapping[Port, Sequence[Value] | npt.NDArray[Any]]

    @property
    def size(self) -> int:
        """Rows."""
        return len(next(iter(self.columns.values()))) if self.columns else 1

    def row(self, k: int) -> dict[Port, Value]:
        """Values of one row."""
        return {port: plain(values[k]) for port, values in self.columns.items()}

    def telling(self) -> list[int]:
        """Rows that have every value, or of many every text and the extreme numbers of each column."""
        if self.size <= FEW:
            return list(range(self.size))
        return sorted({k for port, column in self.columns.items() for k in places(port, column)})


def places(port: Port, column: Sequence[Value] | npt.NDArray[Any]) -> set[int]:
    """Places of the values of a column that tell whether all are fit."""
    if port.variable == "sample_time":  # which has to go with the step of its component
        return {*{value: k for k, value in enumerate(plains(column))}.values()}
    if isinstance(column, np.ndarray) and column.dtype.kind in "fiu":
        return {int(np.argmin(column)), int(np.argmax(column))}
    return telling([*plains(column)])


@dataclass(frozen=True)
class Plan:
    """All runs. A point is one row of every block; the last block varies fastest.

    Run i is that of point i modulo the number of points. It adds i to every seed, so that no two runs have the same
    noise. With common noise it adds how often all points were done before.
    """

    blocks: tuple[Block, ...]
    seeds: int = 1
    is_common: bool = False

    @property
    def points(self) -> int:
        """How many points there are."""
        return prod(block.size for block in self.blocks)

    def __len__(self) -> int:
        return self.points * self.seeds

    @property
    def ports(self) -> list[Port]:
        """What is varied, in the order of the blocks."""
        return [port for block in self.blocks for port in block.columns]

    def over(self, scenario: Scenario) -> Plan:
        """The plan with every combination of the scenario's own sweep, which comes first."""
        rows = [Block({p: [row[p] for row in scenario.rows] for p in scenario.rows[0]})] if scenario.rows else []
        lists = [Block({port: values}) for port, values in scenario.grid.items()]
        return replace(self, blocks=(*rows, *lists, *self.blocks))

    def values_of(self, port: Port) -> Iterator[Value]:
        """All values of a parameter."""
        return next(plains(block.columns[port]) for block in self.blocks if port in block.columns)

    def rows(self, number: int) -> list[int]:
        """Row of each block in a point."""
        left, rows = range(self.points)[number], []
        for block in reversed(self.blocks):
            left, row = divmod(left, block.size)
            rows.append(row)
        return rows[::-1]

    def point(self, number: int) -> dict[Port, Value]:
        """Values of a point."""
        rows = zip(self.blocks, self.rows(number))
        return {port: value for block, row in rows for port, value in block.row(row).items()}

    def values(self, index: int) -> dict[Port, Value]:
        """Values of a run."""
        return self.point(index % self.points)

    def named(self, index: int) -> dict[str, Value]:
        """Values of a run by the names of the parameters."""
        return {str(port): value for port, value in self.values(index).items()}

    def shift(self, index: int) -> int:
        """What a run adds to every seed."""
        return index // self.points if self.is_common else index

    def telling(self) -> list[int]:
        """The first points, and some that have the extreme values of every block."""
        stride, numbers = self.points, set(range(min(self.points, FEW)))
        for block in self.blocks:
            stride //= block.size
            numbers.update(stride * row for row in block.telling())
        return sorted(numbers)


def plain(value: Any) -> Value:
    """A value of numpy as one of Python."""
    made: Value = value.item() if isinstance(value, np.generic) else value
    return made


def plains(column: Sequence[Value] | npt.NDArray[Any]) -> Iterator[Value]:
    """Values of a column as those of Python."""
    return map(plain, column)
