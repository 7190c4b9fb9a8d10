"""What a scenario says, as records. `read.py` reads them from a file, `cosim/check` holds them against the FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import NamedTuple

from gapsense.cosim.events.event import Event
from gapsense.cosim.scenario.elements import Component, Connection, Experiment, Port
from gapsense.cosim.scenario.input_signals import Played
from gapsense.tables import LONGEST, Value, is_number

MOST_RUNS = 10**7  # of a sweep or a campaign


def product(sizes: Iterable[int]) -> str:
    """Factors as a message shows them, those of 1 left out: `3 x 20`."""
    text = " x ".join(str(size) for size in sizes if size != 1)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


NAME = "[A-Za-z_][A-Za-z0-9_]*"  # of a component, whose signals are written `component.variable`, or of an event
METHODS = ("gauss-seidel", "jacobi")
ISOLATIONS = ("none", "process")
MOST_STEPS = 10**10  # of a run: hours for the smallest


@dataclass(frozen=True)
class Record:
    """Patterns of the signals to record, at every `decimation`-th base step."""

    signals: tuple[str, ...] = ("*",)
    decimation: int = 1


@dataclass(frozen=True)
class Metric:
    """One number computed from the samples of a recorded signal with `after < t < before` [s], and where it must lie.

    With an `event` these times are counted from its first beginning.

    For what is published later, the signal `time` has the time [s] that a sample is about; it decides on `after` and
    `before`, and at which row a reference signal is taken.
    """

    name: str
    kind: str
    signal: str
    reference: str | float | None = None
    after: float | None = None
    before: float | None = None
    where: str | None = None  # signal that is 0 at samples to leave out
    time: str | None = None
    event: str | None = None
    bounds: tuple[float, float] | None = None
    description: str = ""
    published: float | None = None  # in a paper or a data sheet, to be shown beside; it is not tested
    table: str = ""  # title of the table in which it is shown
    label: str = ""  # its name there


@dataclass(frozen=True)
class Tolerance:
    """Allowed difference to a reference: `atol + rtol * nominal`, and steps that an edge may come earlier or later."""

    rtol: float = 1e-9
    atol: float = 0.0
    edge_steps: int = 0  # of the component


@dataclass(frozen=True)
class Baseline:
    """Reference trajectory: its file, the patterns compared, the tolerance and its exceptions by pattern.

    Of the recorded rows it holds every `decimation`-th.
    """

    file: Path
    signals: tuple[str, ...] | None = None
    tolerance: Tolerance = Tolerance()
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    declared: bool = False
    decimation: int = 1


class RowsColumn(NamedTuple):
    """Where a column of the rows of a sweep comes from, for messages, and the unit that its head says."""

    file: str
    number: int  # from 1 on
    unit: str  # empty if it says none
    lines: tuple[int, ...]  # of the file, for each row

    def place(self, row: int) -> str:
        """A cell, as messages name it."""
        return f"{self.file}, line {self.lines[row]}, column {self.number}"


@dataclass(frozen=True)
class Points(Sequence[dict[Port, Value]]):
    """Every row with every combination of the values of a grid; each is made when it is asked for."""

    rows: Sequence[Mapping[Port, Value]]
    grid: Mapping[Port, Sequence[Value]]

    def __len__(self) -> int:
        return len(self.rows) * prod(map(len, self.grid.values()))

    def __getitem__(self, index: int) -> dict[Port, Value]:  # type: ignore[override]  # no slices
        left, chosen = range(len(self))[index], dict[Port, Value]()
        for port, values in reversed([*self.grid.items()]):
            left, place = divmod(left, len(values))
            chosen[port] = values[place]
        return {**self.rows[left], **dict(reversed([*chosen.items()]))}

    def telling(self, most: int) -> list[int]:
        """The first points, and of more than `most` those that have every text and the extreme numbers of each port."""
        numbers, stride = {*range(min(len(self), most))}, 1
        rows = {port: [row[port] for row in self.rows] for port in self.rows[0]} if len(self) > most else {}
        for values in reversed([*self.grid.values()] if len(self) > most else []):
            numbers.update(stride * place for place in telling(values))
            stride *= len(values)
        for values in rows.values():
            numbers.update(stride * place for place in telling(values))
        return sorted(numbers)


def telling(values: Sequence[Value]) -> set[int]:
    """Places of the values that tell whether all are fit: every text and truth value, the extremes of the numbers."""
    first: dict[tuple[type, Value], int] = {}
    extremes: dict[tuple[type, bool], int] = {}  # places by type: whole numbers may be asked for
    for place, value in enumerate(values):
        if not is_number(value):
            first.setdefault((type(value), value), place)
            continue
        low, high = (extremes.setdefault((type(value), is_high), place) for is_high in (False, True))
        if value < values[low]:  # type: ignore[operator]  # numbers both
            extremes[type(value), False] = place
        if value > values[high]:  # type: ignore[operator]
            extremes[type(value), True] = place
    return {*first.values(), *extremes.values()}


@dataclass(frozen=True)
class Scenario:
    """A co-simulation as its file describes it, with one variant applied."""

    path: Path
    called: str  # its folder, or what a scenario without a file is called
    title: str
    description: str
    figure: str  # name of the one that shows a run
    variant: str | None
    experiment: Experiment
    components: Mapping[str, Component]
    connections: tuple[Connection, ...]
    inputs: Mapping[Port, Value]  # constants
    seeds: Mapping[str, int]
    grid: Mapping[Port, tuple[Value, ...]]  # a sweep goes through every value with every one of the others
    rows: tuple[Mapping[Port, Value], ...]  # values that belong together; the grid is gone through with each
    record: Record
    metrics: tuple[Metric, ...]
    baseline: Baseline
    variants: Mapping[str, str]  # description of each variant of the file
    tested: tuple[str, ...]  # variants with metrics or a baseline of their own
    files: tuple[Path, ...]  # itself, its parameter sets, files named by parameters: all that decide the result
    rows_columns: Mapping[Port, RowsColumn] = field(default_factory=dict)  # of `rows`
    played: Mapping[Port, Played] = field(default_factory=dict)  # signals that inputs follow
    hashes: Mapping[str, str] = field(default_factory=dict)  # of what decides it too, and stands in no file
    events: Mapping[str, Event] = field(default_factory=dict)
    settings: Mapping[str, Value] = field(default_factory=dict)  # that were laid over it

    @property
    def name(self) -> str:
        """What it is called, with the variant in brackets."""
        return f"{self.called}[{self.variant}]" if self.variant else self.called

    def points(self) -> Points:
        """All combinations of a sweep, in the order of the file, the last parameter fastest; one without a sweep."""
        return Points(self.rows or ({},), self.grid)

    @property
    def swept(self) -> dict[Port, tuple[Value, ...]]:
        """All values that a sweep gives each parameter."""
        of_rows = {port: tuple(row[port] for row in self.rows) for port in (self.rows[0] if self.rows else ())}
        return {**of_rows, **self.grid}
