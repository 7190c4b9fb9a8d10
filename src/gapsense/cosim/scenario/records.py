"""A scenario as records, and what follows from them: points of a sweep, recorded signals, execution order.

`read.py` makes them from a file, `check.py` compares them with the FMUs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import translate
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim.fmu.descriptions import Description, Descriptions, Variable
from gapsense.tables import LONGEST, Value, is_number

FAR = 2.0**53  # base steps, more than any run has: what is farther away is not told apart
STEP_LIMIT = 60.0  # [s]


class Port(NamedTuple):
    """A variable of a component, written `component.variable` (the variable may itself contain dots)."""

    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}"


@dataclass(frozen=True)
class Experiment:
    """Time grid `start + k * base_step` [s], k from 0 to `count`, and how values are exchanged on it."""

    start: float
    stop: float
    base_step: float
    count: int
    method: str = "gauss-seidel"
    pace: float | None = None  # simulated seconds per second of wall time; None: as fast as possible
    isolation: str = "none"  # or the run is in a process of its own
    step_limit: float = STEP_LIMIT  # wall time [s] of one step of a component in another process
    loop_tolerance: float = 1e-8  # of the nominal value: what a loop that is iterated may be off
    loop_evaluations: int = 100  # of a loop in a step, at most
    inputs: str = "hold"  # or `linear`: how they go on in a step, if the component can do that
    step_control: float | None = None  # of the nominal value: what a step may be off; None: all are base steps
    shortest_step: int = 1  # base steps between two exchanges of values
    longest_step: int | None = None

    def time(self, index: int) -> float:
        """Time of base step `index` [s], computed by multiplication so that errors do not add up."""
        return self.start + index * self.base_step


@dataclass(frozen=True)
class Component:
    """One FMU instance; its step and offset are in base steps."""

    name: str
    fmu: str
    step: int = 1
    offset: int = 0
    edge: str = ""  # output that says where in its step a loop should end it [s]
    values: Mapping[str, Value] = field(default_factory=dict)  # of parameters
    origin: Mapping[str, str] = field(default_factory=dict)  # the file or table where each value comes from
    sets: Mapping[Path, Mapping[str, Value]] = field(default_factory=dict)  # its parameter sets, see `taken`
    isolation: str = "none"  # or the instance is in a process of its own
    board: str = ""  # on which it runs, as `cosim/fmu/line.py` reads it; the FMU goes along
    firmware: Path | None = None  # for a board that is emulated
    clock: float | None = None  # of the board [Hz]


@dataclass(frozen=True)
class Connection:
    """`target` receives `factor * source + bias`; `unit` is that after the conversion, `place` where it is written.

    A connection that is `delayed` carries the value of one step before: its target steps before its source. One that is
    a `mean` over the step has this value in the whole of it, also at an input that interpolates.
    """

    source: Port
    target: Port
    factor: float | None = None
    bias: float | None = None
    unit: str | None = None
    delayed: bool = False
    mean: bool = False
    place: str = ""

    @property
    def converts(self) -> bool:
        """True if the connection states a conversion, and so may join different units."""
        return self.factor is not None or self.bias is not None

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


# Times of events on the grid of base steps.


def nearest(steps: float) -> int:
    """The whole number of base steps nearest to another one."""
    return round(max(-FAR, min(steps, FAR)))


def index_of(time: float, experiment: Experiment) -> int:
    """The base step nearest to a time [s]."""
    return nearest((time - experiment.start) / experiment.base_step)


def is_on_grid(time: float, experiment: Experiment) -> bool:
    """True if a time [s] is that of a base step up to rounding."""
    slack = 1e-9 * experiment.base_step + 1e-15 * (abs(experiment.start) + abs(time))
    return abs(experiment.time(index_of(time, experiment)) - time) <= slack


def steps_of(length: float | None, experiment: Experiment) -> int:
    """A length of time [s] in base steps; 0 for none."""
    return 0 if length is None else nearest(length / experiment.base_step)


def neighbours(time: float, experiment: Experiment) -> tuple[float, float]:
    """Times of the base steps before and after a time [s] between them."""
    k = index_of(time, experiment)
    first = k if experiment.time(k) < time else k - 1
    return experiment.time(first), experiment.time(first + 1)


# What a scenario says of an event, as records, and what actions there are.


Buffer = npt.NDArray[np.float64]
TIMES = ("at", "until", "duration", "over", "when.for", "when.after")  # keys in seconds
NEEDED, MAY_BE = "needed", "may be given"
SECTION = "events"  # of the file; in a sweep it stands where others have a component


class Action(NamedTuple):
    """What an event does to its target, and what it needs for that."""

    what: str
    value: str = ""  # what `value` is, empty where there is none
    over: str = ""  # NEEDED, MAY_BE, or empty where it takes no time
    on_parameter: bool = True
    only_real: bool = True
    remembers: bool = False  # needs the value that there was just before


ACTIONS: Mapping[str, Action] = {
    "set": Action("has the value", "the value", only_real=False),
    "ramp": Action(
        "goes in a straight line from its old value to the new one", "its last value", NEEDED, remembers=True
    ),
    "bias": Action("is shifted by the value", "what is added", MAY_BE),
    "scale": Action("is multiplied by the value", "the factor", MAY_BE),
    "stuck": Action("keeps its last value", on_parameter=False, only_real=False, remembers=True),
    "dropout": Action("is NaN: the sample was lost", on_parameter=False),
    "noise": Action("has normal noise added", "its standard deviation"),
}


@dataclass(frozen=True)
class When:
    """A condition: the signal is above (or below) a level, for some time [s], counted from a time [s] on."""

    signal: Port
    level: float
    is_above: bool
    lasting: float = 0.0
    after: float | None = None
    again: bool = False  # it counts again after the event, once it has not held


@dataclass(frozen=True)
class Event:
    """One action on an input, an output or a tunable parameter from `at` [s], or from where a condition holds.

    It lasts until `until` [s], or for `duration` [s], or to the end of the run. `given` is its table in the file.
    """

    name: str
    target: Port
    action: str
    value: Value | None = None
    over: float | None = None  # [s]
    at: float | None = None
    until: float | None = None
    duration: float | None = None
    when: When | None = None
    seed: int = 0
    enabled: bool = True
    description: str = ""
    given: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_random(self) -> bool:
        """True if each sample has a random number of its own."""
        return self.action == "noise"

    @property
    def seed_name(self) -> str:
        """Its name among the seeds of a run."""
        return f"{SECTION}.{self.name}"


def resolve_targets(events: Mapping[str, Event], connections: Iterable[Connection]) -> dict[str, Event]:
    """Give events one input or parameter each: one on an output becomes one on each input that this drives."""
    driven: dict[Port, list[Port]] = {}
    for connection in connections:
        driven.setdefault(connection.source, []).append(connection.target)
    found: dict[str, Event] = {}
    for name, event in events.items():
        targets = driven.get(event.target)
        more = {f"{name} {target}": replace(event, target=target) for target in targets or ()}
        found.update(more or {name: event})
    return found


class Span(NamedTuple):
    """When an event was on: begin and end [s]; None for one that was still on at the end of the run."""

    name: str
    target: str
    action: str
    begin: float
    end: float | None


# Conditions on signals, which the loop over base steps looks at: it comes back when one begins or ends to hold.


@dataclass
class Threshold:
    """Whether the value in a place of the buffer is above (or below) a level, as it was known last."""

    place: int
    level: float
    is_above: bool
    is_on: bool = False  # whether it is watched now
    holds: bool = False

    def look(self, buffer: Buffer) -> bool:
        """True if the condition holds now; NaN is neither above nor below."""
        value = buffer[self.place]
        return bool(value > self.level if self.is_above else value < self.level)


def reporter(watches: Sequence[Threshold], buffer: Buffer) -> Callable[[], bool]:
    """Function that says if there is news of some conditions."""
    return lambda: any(watch.is_on and watch.look(buffer) != watch.holds for watch in watches)


# Signals of the scenario that inputs follow: samples, and what holds between them.


Vector = npt.NDArray[np.float64]
INTERPOLATIONS = ("linear", "hold")
SLACK = 1e-9  # of a base step: a sample due at the same time up to rounding has its value


@dataclass(frozen=True, eq=False)
class Played:
    """Values at rising times; between them they are interpolated, or each holds until the next."""

    times: Vector  # [s]
    values: Vector
    interpolation: str = INTERPOLATIONS[0]
    unit: str = ""  # that a file says

    def at(self, times: Vector, slack: float = 0.0) -> Vector:
        """Values at some times within the samples."""
        if self.interpolation == "linear":
            between: Vector = np.interp(times, self.times, self.values)
            return between
        places = np.searchsorted(self.times, times + slack, side="right") - 1
        held: Vector = self.values[np.clip(places, 0, None)]
        return held


MOST_RUNS = 10**7  # of a sweep or a campaign
FEW = 1000  # values of a block that are all looked at, and points


def product(sizes: Iterable[int]) -> str:
    """Factors as a message shows them, those of 1 left out: `3 x 20`."""
    text = " x ".join(str(size) for size in sizes if size != 1)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


NAME = "[A-Za-z_][A-Za-z0-9_]*"  # of a component, whose signals are written `component.variable`, or of an event
ITERATIVE, JACOBI = "iterative", "jacobi"
METHODS = ("gauss-seidel", JACOBI, ITERATIVE)
ISOLATIONS = ("none", "process")
MOST_STEPS = 10**10  # of a run: hours for the smallest


@dataclass(frozen=True)
class Record:
    """Patterns of the signals to record, at every `decimation`-th base step."""

    signals: tuple[str, ...] = ("*",)
    decimation: int = 1


class Page(NamedTuple):
    """Parameters that a page lets its reader change, and recorded signals whose plots come first."""

    controls: tuple[str, ...] = ()
    first: tuple[str, ...] = ()


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
    flows: tuple[str, ...] | None = None  # of a bond, at the end of the signal and of the reference
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
        return sorted({k for port, column in self.columns.items() for k in telling(port, column)})


def blocks(rows: Sequence[Mapping[Port, Value]], grid: Mapping[Port, Sequence[Value]]) -> tuple[Block, ...]:
    """Rows with every combination of the values of a grid."""
    first = [Block({port: [row[port] for row in rows] for port in rows[0]})] if rows else []
    return (*first, *(Block({port: values}) for port, values in grid.items()))


def telling(port: Port, column: Sequence[Value] | npt.NDArray[Any]) -> set[int]:
    """Places of the values of a column that tell whether all are fit: every text, the extremes of the numbers."""
    if isinstance(column, np.ndarray) and column.dtype.kind in "fiu" and port.variable != "sample_time":
        return {int(np.argmin(column)), int(np.argmax(column))}
    places: dict[object, int] = {}
    extremes: dict[tuple[type, bool], int] = {}  # by type: whole numbers may be asked for
    values = [*map(plain, column)]
    for place, value in enumerate(values):
        if port.variable == "sample_time" or not is_number(value):  # the former has to go with a component's step
            places.setdefault((type(value), value), place)
            continue
        low, high = (extremes.setdefault((type(value), is_high), place) for is_high in (False, True))
        if value < values[low]:  # type: ignore[operator]  # numbers both
            extremes[type(value), False] = place
        if value > values[high]:  # type: ignore[operator]
            extremes[type(value), True] = place
    return {*places.values(), *extremes.values()}


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

    def values_of(self, port: Port) -> Iterator[Value]:
        """All values of a parameter."""
        return next(map(plain, block.columns[port]) for block in self.blocks if port in block.columns)

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

    def name_values(self, index: int) -> dict[str, Value]:
        """Name the values of a run by its parameters."""
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


@dataclass(frozen=True)
class Scenario:
    """A co-simulation as its file describes it, with one variant applied."""

    path: Path
    called: str  # its folder, or what a scenario without a file is called
    title: str
    description: str
    figure: str  # name of the figure that shows a run
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
    page: Page = field(default_factory=Page)

    @property
    def name(self) -> str:
        """What it is called, with the variant in brackets."""
        return f"{self.called}[{self.variant}]" if self.variant else self.called

    @property
    def plan(self) -> Plan:
        """All combinations of a sweep, in the order of the file, the last parameter fastest; one without a sweep."""
        return Plan(blocks(self.rows, self.grid))

    @property
    def swept(self) -> dict[Port, Sequence[Value]]:
        """All values that a sweep gives each parameter."""
        of_rows = {port: tuple(row[port] for row in self.rows) for port in (self.rows[0] if self.rows else ())}
        return {**of_rows, **self.grid}


# Signals of a scenario, inputs and outputs of its components, and the patterns that select them.


def ports(descriptions: Descriptions) -> dict[Port, Variable]:
    """Every input and output that is a number, in the order of the buffer.

    The order for each component is: Real inputs, Real outputs, other outputs, other inputs. So the numbers that one
    call moves lie side by side.
    """
    return {
        Port(name, variable.name): variable
        for name, description in descriptions.items()
        for variable in side_by_side(description)
    }


def side_by_side(description: Description) -> list[Variable]:
    """Numeric inputs and outputs of an FMU in the order of the buffer."""
    inputs, outputs = ([v for v in description.of(c) if v.type != "String"] for c in ("input", "output"))
    real, other = ([v for v in inputs if (v.type == "Real") == is_real] for is_real in (True, False))
    return [*real, *sorted(outputs, key=lambda v: v.type != "Real"), *other]


def texts(descriptions: Descriptions) -> dict[Port, Variable]:
    """Every input and output that is a text."""
    return {
        Port(name, variable.name): variable
        for name, description in descriptions.items()
        for variable in (*description.of("input"), *description.of("output"))
        if variable.type == "String"
    }


def signals(descriptions: Descriptions) -> dict[str, Variable]:
    """Every signal that can be recorded, in the order of the buffer, by `component.variable`."""
    return {str(port): variable for port, variable in ports(descriptions).items()}


def matching(patterns: Iterable[str], names: Iterable[str]) -> list[str]:
    """Names that are or match one of the patterns, in the order of the names."""
    exact = frozenset(patterns := tuple(patterns))
    matches = re.compile("|".join(map(translate, patterns)) or "(?!)").match
    return [name for name in names if name in exact or matches(name)]


def recorded_signals(scenario: Scenario, descriptions: Descriptions) -> dict[str, Variable]:
    """Signals that a run of this scenario records."""
    known = signals(descriptions)
    return {name: known[name] for name in matching(scenario.record.signals, known)}


# Execution order of the components: that of the connections, with loops cut where there is no direct feedthrough.


@dataclass(frozen=True)
class Order:
    """Components in the order in which they step, and the connections that carry the value of one step before.

    With `iterative` there are loops too: components that step together, neighbours in the order.
    """

    names: tuple[str, ...]
    delayed: tuple[Connection, ...] = ()
    loops: tuple[tuple[str, ...], ...] = ()


class FeedthroughCycleError(ValueError):
    """Every input on this loop has direct feedthrough, so no order avoids an algebraic loop."""

    def __init__(self, cycle: Sequence[Connection]) -> None:
        super().__init__(
            f"algebraic loop through {', '.join(map(str, cycle))}: every input on it has direct feedthrough. "
            'Solve it in every step with `method = "iterative"` in `[experiment]`, or break it with a component '
            "without feedthrough, such as a delay or a lag, or with `delayed = true` in `[[connections]]`."
        )


def execution_order(
    names: Sequence[str], connections: Sequence[Connection], descriptions: Descriptions, method: str = METHODS[0]
) -> Order:
    """Order in which every component follows those that drive it, as far as there are no loops.

    In a loop, a component all of whose waiting inputs lack direct feedthrough goes first; the connections to these
    inputs then carry the value of one step before. Where a connection is to be delayed, its source follows its target.
    Among equals the order of the file decides, that of `names`.
    Raises FeedthroughCycleError if a loop has nothing but direct feedthrough, unless loops are iterated.
    """
    if method == ITERATIVE:
        return order_of_loops(names, connections)
    left, done, delayed = list(names), [], [c for c in connections if c.delayed]
    ways = [
        replace(c, source=c.target, target=c.source) if c.delayed else c
        for c in connections
        if not (c.delayed and c.source.component == c.target.component)
    ]
    while left:
        edges = [c for c in ways if {c.source.component, c.target.component} <= set(left)]
        direct = [c for c in edges if c.delayed or c.target.variable in descriptions[c.target.component].direct_inputs]
        driven = {c.target.component for c in edges}
        waiting = {c.target.component for c in direct}
        free = [n for n in left if n not in driven] or [n for n in first_loops(left, edges) if n not in waiting]
        if not free:
            raise FeedthroughCycleError(find_cycle(left, direct))
        delayed += [c for c in edges if c.target.component == free[0]]
        left.remove(free[0])
        done.append(free[0])
    return Order(tuple(done), tuple(delayed))


def order_of_loops(names: Sequence[str], connections: Sequence[Connection]) -> Order:
    """Order in which every loop follows what drives it; inside of one, who waits for the fewest outputs goes first."""
    left, done, loops = list(names), list[str](), list[tuple[str, ...]]()
    while left:
        edges = [c for c in connections if not c.delayed and {c.source.component, c.target.component} <= set(left)]
        driven = {c.target.component for c in edges}
        chosen = next((name for name in left if name not in driven), None)
        loop = [chosen] if chosen else next(iter(first_loops(left, edges).values()))
        inside = list(loop)
        while inside:
            waits = {name: {c.source for c in edges if c.target.component == name} for name in inside}
            first = min(inside, key=lambda name: sum(port.component in inside for port in waits[name]))
            inside.remove(first)
            left.remove(first)
            done.append(first)
        if not chosen:
            loops.append(tuple(done[-len(loop) :]))
    return Order(tuple(done), tuple(c for c in connections if c.delayed), tuple(loops))


def first_loops(left: Sequence[str], edges: Sequence[Connection]) -> dict[str, list[str]]:
    """The loop of each component that is in one which nothing outside of it drives."""
    ahead = {name: find_reached(name, edges) for name in left}
    behind = {name: [other for other in left if name in ahead[other]] for name in left}
    return {name: behind[name] for name in left if {*behind[name]} <= ahead[name]}


def find_reached(name: str, edges: Collection[Connection]) -> set[str]:
    """Find components that a component drives, directly or through others."""
    seen: set[str] = set()
    fresh = {name}
    while fresh:
        fresh = {c.target.component for c in edges if c.source.component in fresh} - seen
        seen |= fresh
    return seen


def find_cycle(left: Sequence[str], direct: Sequence[Connection]) -> list[Connection]:
    """A loop of direct feedthrough, found by walking against the connections until a component comes twice."""
    on_cycle = next(name for name in left if name in find_reached(name, direct))
    path: list[Connection] = []
    seen: list[str] = []
    while on_cycle not in seen:
        seen.append(on_cycle)
        onward = find_reached(on_cycle, direct)
        path.append(next(c for c in direct if c.target.component == on_cycle and c.source.component in onward))
        on_cycle = path[-1].source.component
    return path[seen.index(on_cycle) :][::-1]
