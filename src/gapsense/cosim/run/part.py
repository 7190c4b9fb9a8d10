"""A component inside the master: its share of the common buffer, and the raw calls that move it."""

from __future__ import annotations

import ctypes
import math
import sys
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.processes import Marks
from gapsense.cosim.fmu.descriptions import Descriptions, Variable
from gapsense.cosim.fmu.instance import ENDS, ENDS_WITHIN, STEP, WARNING, Instance, referring
from gapsense.cosim.run.recording import Recording
from gapsense.cosim.scenario.records import (
    SLACK,
    Component,
    Connection,
    Event,
    Experiment,
    Played,
    Port,
    Scenario,
    Threshold,
    Vector,
)
from gapsense.problems import FmuError
from gapsense.tables import Value

Texts = dict[Port, str]  # values of String variables; the buffer holds all others
NOT_FITTING = "not fitting"
EXACT = 2**53  # up to here every whole number is a double
Stepper = Callable[[float], str]
NOT_FINITE = "not finite"


class Wire(NamedTuple):
    """What the loop copies: places in the buffer, and `factor * value + bias` if it converts."""

    target: int
    source: int
    converts: bool
    factor: float
    bias: float


@dataclass(frozen=True)
class Layout:
    """Where each input and output lies in the common buffer, see `signals.ports`; a String has no place in it.

    Behind them are the places of events on inputs; values for an input with events go to its inlet. Last come those for
    the earlier values of outputs, which connections that are `delayed` carry in a loop that is iterated.
    """

    variables: Mapping[Port, Variable]
    texts: Mapping[Port, Variable] = field(default_factory=dict)
    events: Mapping[str, Event] = field(default_factory=dict)
    delayed: Sequence[Connection] = ()

    @cached_property
    def index(self) -> dict[Port, int]:
        """Place in the buffer of each port."""
        return {port: index for index, port in enumerate(self.variables)}

    @cached_property
    def slots(self) -> dict[str, Slot]:
        """Places of the stage of each event on an input."""
        found: dict[str, Slot] = {}
        ends, free = dict(self.index), len(self.index)
        for name, event in reversed([*self.events.items()]):  # the last one is next to the input
            if event.target in self.index:
                found[name] = Slot(free, free + 1, ends[event.target])
                ends[event.target] = free
                free += 2
        return {name: found[name] for name in self.events if name in found}

    def slots_of(self, component: str) -> dict[str, Slot]:
        """Those of the events on inputs of a component."""
        return {name: slot for name, slot in self.slots.items() if self.events[name].target.component == component}

    @cached_property
    def inlets(self) -> dict[Port, int]:
        """Where the values for each port go: to its first stage, or where the port itself is."""
        first = {self.events[name].target: slot.before for name, slot in reversed([*self.slots.items()])}
        return {**self.index, **first}

    @property
    def size(self) -> int:
        """Places in the buffer, at least one."""
        return max(1, len(self.variables) + 2 * len(self.slots) + len(self.earlier))

    @cached_property
    def earlier(self) -> dict[Port, int]:
        """Place of the earlier value of each output that is delayed."""
        ports, first = dict.fromkeys(c.source for c in self.delayed), len(self.variables) + 2 * len(self.slots)
        return {port: first + k for k, port in enumerate(ports)}

    def remember(self, buffer: array[float], texts: Texts) -> None:
        """Keep the values that outputs have now for the connections that are delayed."""
        for port, place in self.earlier.items():
            if port in self.index:
                buffer[place] = buffer[self.index[port]]
            else:
                texts[before(port)] = texts[port]

    def wires(self, connections: Sequence[Connection], component: str) -> list[Wire]:
        """Connections of numbers into a component, those that convert last."""
        found = []
        for c in connections:
            if c.target.component == component and c.target in self.index:
                line = (1.0 if c.factor is None else c.factor, c.bias or 0.0)
                source = self.earlier[c.source] if c.delayed and c.source in self.earlier else self.index[c.source]
                found.append(Wire(self.inlets[c.target], source, c.converts, *line))
        return sorted(found, key=lambda wire: wire.converts)

    def of(self, component: str, causality: str) -> list[Port]:
        """Inputs or outputs of a component, in the order of the buffer."""
        return [p for p, v in self.variables.items() if p.component == component and v.causality == causality]

    def strings_of(self, component: str, causality: str) -> list[Port]:
        """String inputs or outputs of a component."""
        return [p for p, v in self.texts.items() if p.component == component and v.causality == causality]

    def variable(self, port: Port) -> Variable:
        """The variable of a port of any type."""
        return self.texts[port] if port in self.texts else self.variables[port]


@dataclass(frozen=True)
class Effect:
    """`factor * value + bias`, or without a factor `bias` whatever the value is."""

    factor: float | None
    bias: Value

    def of(self, value: Value) -> Value:
        """What becomes of a value."""
        return self.bias if self.factor is None else self.factor * float(value) + float(self.bias)


class Stage:
    """What an event does to a value on its way to an input: copies it, or another one, or shifts and scales it."""

    def __init__(self, slot: Slot) -> None:
        self.slot, self.source, self.converts, self.factor, self.bias = slot, slot.before, False, 1.0, 0.0

    def apply(self, effect: Effect | None, buffer: Any) -> None:
        """Do this from now on; without an effect nothing."""
        self.source, self.converts, self.factor, self.bias = self.slot.before, False, 1.0, 0.0
        if effect is None:
            return
        if effect.factor is None:
            self.source, buffer[self.slot.held] = self.slot.held, float(effect.bias)
        else:
            self.converts, self.factor, self.bias = True, effect.factor, float(effect.bias)

    def state(self) -> tuple[Any, ...]:
        """What it does; a value that it holds is in the buffer."""
        return self.source, self.converts, self.factor, self.bias

    def restore(self, saved: Sequence[Any]) -> None:
        """Do that again."""
        self.source, self.converts, self.factor, self.bias = saved


class Channel:
    """Variables of one type of an FMU that move in one call: their array, and the places that these values have.

    The array of doubles that are neighbours in the buffer lies in the buffer itself.
    """

    def __init__(
        self, instance: Instance, action: str, ports: Sequence[Port], places: Layout, buffer: array[float]
    ) -> None:
        variables = [places.variable(port) for port in ports]
        self.kind, self.range, c_type = variables[0].type, variables[0].range, instance.c_type(variables[0])
        self.ports = tuple(ports)
        self.places = [] if self.kind == "String" else [places.index[port] for port in ports]
        first = self.places[0] if self.places else 0
        self.is_in_place = c_type is ctypes.c_double and self.places == [*range(first, first + len(ports))]
        array_type = c_type * len(ports)
        self.values = array_type.from_buffer(buffer, 8 * first) if self.is_in_place else array_type()
        self.read = memoryview(buffer)[first : first + len(ports)] if self.is_in_place else self.values
        self.function, self.references = instance.accessor(action, variables[0]), referring(variables)
        self.move = instance.mover(action, variables, self.values)

    def fill(self, buffer: array[float], texts: Texts) -> str:
        """Take the values for the FMU; what is wrong with one, or nothing."""
        values, kind = self.values, self.kind
        if kind == "String":
            values[:] = [texts[port].encode("utf-8") for port in self.ports]
        elif self.range is None:
            values[:] = [buffer[place] if kind == "Real" else buffer[place] != 0.0 for place in self.places]
        else:
            low, high = self.range
            for j, place in enumerate(self.places):
                if not low <= buffer[place] <= high:
                    return f"input `{self.ports[j].variable}` gets {buffer[place]:.17g}, {low} to {high} expected"
                values[j] = int(buffer[place])
        return ""

    def empty(self, buffer: array[float], texts: Texts) -> str:
        """Keep the values that the FMU gave; what is wrong with one, or nothing."""
        if self.kind == "String":
            texts.update(
                (port, (value or b"").decode("utf-8", "replace")) for port, value in zip(self.ports, self.values)
            )
            return ""
        if not self.is_in_place:
            for port, place, value in zip(self.ports, self.places, self.values):
                if self.range and abs(value) > EXACT:
                    return f"output `{port.variable}` is {value}; integers beyond 2**53 are not exact"
                buffer[place] = value
        are_finite = math.isfinite(sum(self.read)) or all(map(math.isfinite, self.read))
        return "" if are_finite else NOT_FINITE


def channels(
    instance: Instance, action: str, ports: Sequence[Port], places: Layout, buffer: array[float]
) -> tuple[Channel, ...]:
    """Channels for all these ports, one for each type."""

    def type_of(port: Port) -> str:
        variable: Variable = places.variable(port)
        return variable.size or variable.type

    groups = groupby(sorted(ports, key=type_of), key=type_of)
    return tuple(
        Channel(instance=instance, action=action, ports=list(alike), places=places, buffer=buffer)
        for _, alike in groups
    )


class Part:
    """One component of a run: connections into it, exchange with the buffer, and its step."""

    def __init__(
        self, component: Component, instance: Instance, buffer: array[float], places: Layout, texts: Texts
    ) -> None:
        self.component, self.instance, self.buffer, self.places = component, instance, buffer, places
        self.texts, self.spoken, self.problem = texts, list[tuple[Port, Port]](), ""
        self.wires: list[Wire] = []
        self.means: set[Port] = set()  # inputs that have a mean over the step
        self.late: set[Port] = set()  # inputs that keep the value of the beginning of the step
        self.held: set[Port] = set()  # those that cannot go on from their last two values
        self.outputs = places.of(component.name, "output")
        self.edges = [places.index[Port(component.name, component.edge)]] if component.edge else []
        self.stages = {name: Stage(slot) for name, slot in places.slots_of(component.name).items()}
        self.is_played = False  # an input follows a signal of the scenario
        self.status = self.warnings = 0  # of the last call; steps that returned a warning
        self.ended = 0  # what its orderly end was, if it has ended
        name = component.name
        self.givers, self.readers = (
            channels(instance, action, [*places.of(name, kind), *places.strings_of(name, kind)], places, buffer)
            for action, kind in (("Set", "input"), ("Get", "output"))
        )

    @property
    def is_direct(self) -> bool:
        """True if C may call the FMU without Python: its values are doubles in the buffer."""
        return self.instance.is_near and all(channel.is_in_place for channel in (*self.givers, *self.readers))

    @property
    def follows(self) -> bool:
        """True if an input may change during a run."""
        return bool(self.wires or self.stages or self.is_played or self.spoken)

    def interpolates(self, experiment: Experiment) -> bool:
        """True if its inputs go in a straight line in a step: it takes their slopes, and the experiment asks for it."""
        can = experiment.inputs == "linear" and self.instance.description.can_interpolate
        return can and self.follows and any(channel.is_in_place for channel in self.givers)

    def connect(self, connections: Sequence[Connection]) -> None:
        """Let inputs follow outputs from now on."""
        self.wires = self.places.wires(connections, self.component.name)
        own = self.places.strings_of(self.component.name, "input")
        late = self.places.earlier
        self.means = {c.target for c in connections if c.mean}
        self.spoken = [
            (c.target, before(c.source) if c.delayed and c.source in late else c.source)
            for c in connections
            if c.target in own
        ]

    def taker(self, copy: Callable[[], None] | None = None) -> Callable[[], str]:
        """Function that copies connected outputs into the inputs and sets these; returns what failed, or nothing."""
        buffer, texts, spoken, givers = self.buffer, self.texts, tuple(self.spoken), self.givers
        copy = copy or self.copier()

        def take() -> str:
            copy()
            for heard, said in spoken:
                texts[heard] = texts[said]
            for channel in givers:
                if not channel.is_in_place and (problem := channel.fill(buffer, texts)):
                    return self.unfit(problem)
                status = channel.move()
                if status > WARNING:
                    return self.check_status(status, channel.function)
            return ""

        return take

    def copier(self) -> Callable[[], None]:
        """Function that copies connected outputs into the inputs."""
        buffer, stages = self.buffer, tuple(self.stages.values())
        plain = tuple((wire.target, wire.source) for wire in self.wires if not wire.converts)
        scaled = tuple(wire for wire in self.wires if wire.converts)

        def copy() -> None:
            for target, source in plain:
                buffer[target] = buffer[source]
            for target, source, _, factor, bias in scaled:
                buffer[target] = factor * buffer[source] + bias
            for stage in stages:
                value = buffer[stage.source]
                buffer[stage.slot.after] = stage.factor * value + stage.bias if stage.converts else value

        return copy

    def read_outputs(self) -> str:
        """Read the outputs; what failed, or nothing."""
        return self.reader()()

    def reader(self) -> Callable[[], str]:
        """Function that reads the outputs; returns what failed, or nothing."""
        calls = [(channel.move, channel.empty, channel.function) for channel in self.readers]
        buffer, texts, warning = self.buffer, self.texts, WARNING

        def read() -> str:
            for move, empty, function in calls:
                status = move()
                if status > warning:
                    return self.check_status(status, function)
                problem = empty(buffer, texts)
                if problem:
                    return problem if problem == NOT_FINITE else self.unfit(problem)
            return ""

        return read

    def unfit(self, problem: str) -> str:
        """That a value does not fit, with what is wrong kept for the message."""
        self.problem = problem
        return NOT_FITTING

    def check_status(self, status: int, function: str) -> str:
        """Return nothing for a good status, otherwise the function's name; the status is kept for the message."""
        self.status = status
        return function if status > WARNING else ""

    def stepper(self, duration: float, take: Callable[[], str] | None = None) -> Stepper:
        """Function of the start time that takes inputs, does a step and reads outputs; what failed, or nothing."""
        do, read = self.instance.doer(duration), self.reader()

        def step(start: float) -> str:
            failed = take() if take else ""
            if failed:
                return failed
            if status := do(start):
                self.warnings += status == WARNING
                if status > WARNING and not self.has_ended(status):
                    return self.check_status(status, STEP)
            return read()

        return step

    def has_ended(self, status: int) -> bool:
        """True for the status of the orderly end of the component, which is kept."""
        self.ended = status if status in (ENDS, ENDS_WITHIN) else 0
        return self.ended > 0

    def failure(self, what: str, time: float, index: int) -> FmuError:
        """Error for what a step returned."""
        if what not in (NOT_FINITE, NOT_FITTING):
            return self.instance.failure(what, self.status, time, index)
        cause = f"{self.problem}."
        if what == NOT_FINITE:
            found = ((port.variable, self.buffer[self.places.index[port]]) for port in self.outputs)
            bad = [f"`{name}` is {value}" for name, value in found if not math.isfinite(value)]
            cause = f"output {', '.join(bad)}. Look at its inputs and parameters{self.instance.said()}."
        return FmuError(self.component.name, cause, time=time, step=index, log=self.instance.log())


# Where events act on the values that go to inputs: places behind those of the ports in the common buffer.
#
# The value for an input with n events goes through n stages, in the order of the file. A stage has the place from which
# it takes the value, a place for a value that it holds instead, and the place of the next stage or of the input.


class Slot(NamedTuple):
    """Places of a stage."""

    before: int
    held: int
    after: int


# What inputs get that no output drives: constants, and signals of the scenario.


def before(port: Port) -> Port:
    """What stands for a text output as it was a step before."""
    return Port("", str(port))


def constants(scenario: Scenario, descriptions: Descriptions, swept: Mapping[Port, Value]) -> dict[Port, Value]:
    """Values of inputs at the start: those of `[inputs]`, and those that the `set` of a component or a sweep gives."""
    given = {Port(name, n): v for name, component in scenario.components.items() for n, v in component.values.items()}
    known = {Port(name, v.name): v for name, description in descriptions.items() for v in description.of("input")}
    values = {**given, **swept, **scenario.inputs}
    return {port: known[port].number(value) for port, value in values.items() if port in known}


def place(port: Port, value: Value, places: Layout, buffer: array[float], texts: dict[Port, str]) -> None:
    """Put the value of an input where the part of its component takes it."""
    if port in places.index:
        buffer[places.inlets[port]] = float(value)
    else:
        texts[port] = str(value)


# What the loop over base steps has to do, and who steps when: part i at `offset + j * step`, j >= 1.


# Does base steps up to the one given, and returns the last one done. That is an earlier one if it was told to stop, if
# Python should look up, or if a condition has news.
Advance = Callable[[int], int]


class Work(NamedTuple):
    """A run whose parts are initialised, and whose first base step to do is `begin`.

    Base step 0 is the start: nobody steps, with Jacobi inputs are exchanged, and the first row is recorded.
    """

    parts: Sequence[Part]  # in execution order
    experiment: Experiment
    player: Player
    columns: npt.NDArray[np.int64]  # places of the buffer to record
    decimation: int
    buffer: npt.NDArray[np.float64]
    recording: Recording  # has the seconds and calls of each part
    marks: Marks
    begin: int
    watches: Sequence[Threshold] = ()  # conditions of which news end a block
    loops: Sequence[Sequence[int]] = ()  # places among the parts of those that repeat each step together
    limit: Callable[[], int] = lambda: sys.maxsize  # the next base step after which events change


def first_turn(component: Component, begin: int) -> int:
    """The first base step from `begin` on at which a component steps."""
    return component.offset + component.step * (max(0, begin - 1 - component.offset) // component.step + 1)


def first_exchange(component: Component, begin: int) -> int:
    """The first base step from `begin` on at which a component takes inputs, with Jacobi: where a step of it begins."""
    return component.offset if begin <= component.offset else first_turn(component, begin)


Matrix = npt.NDArray[np.float64]


BLOCK = 4096  # base steps computed at once


class Player:
    """Values that go to places of the buffer at each base step; `rows` gives those from one on, many at once."""

    def __init__(self, places: Sequence[int], rows: Callable[[int], Matrix]) -> None:
        self.places, self.rows = np.array(places, dtype=np.int64), rows
        self.begin, self.block = 0, np.empty((0, len(places)))

    def provide(self, k: int) -> int:
        """Have the values of a base step; the last one of which there are some."""
        if not self.begin <= k < self.begin + len(self.block):
            self.begin, self.block = k, np.ascontiguousarray(self.rows(k))
        return self.begin + len(self.block) - 1

    def into(self, buffer: Vector) -> Callable[[int], None]:
        """Function of the base step that puts its values into the buffer."""

        def play(k: int) -> None:
            self.provide(k)
            buffer[self.places] = self.block[k - self.begin]

        return play if len(self.places) else lambda k: None


def player(signals: Mapping[Port, Played], index: Mapping[Port, int], experiment: Experiment) -> Player:
    """What plays the signals of a scenario: the value of each at the time of the base step."""

    def rows(k: int) -> Matrix:
        """Values (BLOCK, signals) from a base step on."""
        times = experiment.start + np.arange(k, k + BLOCK, dtype=np.float64) * experiment.base_step
        slack = SLACK * experiment.base_step
        values = np.array([signal.at(times, slack) for signal in signals.values()])
        return values.reshape(len(signals), BLOCK).T

    return Player([index[port] for port in signals], rows)
