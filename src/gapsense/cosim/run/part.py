"""A component inside the master: its share of the common buffer, and the raw calls that move it."""

from __future__ import annotations

import ctypes
import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from gapsense.cosim.events.actor import Effect
from gapsense.cosim.events.event import Event
from gapsense.cosim.events.slots import Slot, inlets, slots
from gapsense.cosim.fmu.instance import ENDS, ENDS_WITHIN, STEP, WARNING, Instance, referring
from gapsense.cosim.fmu.variables import Variable
from gapsense.cosim.run.failure import FmuError
from gapsense.cosim.scenario.elements import Component, Connection, Port
from gapsense.tables import Value

Stepper = Callable[[float], str]
NOT_FINITE = "not finite"


@dataclass(frozen=True)
class Layout:
    """Where each input and output lies in the common buffer, see `signals.ports`; a String has no place in it.

    Behind them are the places of events on inputs; values for an input with events go to its inlet.
    """

    variables: Mapping[Port, Variable]
    texts: Mapping[Port, Variable] = field(default_factory=dict)
    events: Mapping[str, Event] = field(default_factory=dict)

    @cached_property
    def index(self) -> dict[Port, int]:
        """Place in the buffer of each port."""
        return {port: index for index, port in enumerate(self.variables)}

    @cached_property
    def slots(self) -> dict[str, Slot]:
        """Places of each event on an input."""
        return slots(self.events, self.index)

    def slots_of(self, component: str) -> dict[str, Slot]:
        """Those of the events on inputs of a component."""
        return {name: slot for name, slot in self.slots.items() if self.events[name].target.component == component}

    @cached_property
    def inlets(self) -> dict[Port, int]:
        """Where the values for each input go."""
        return inlets(self.events, self.index, self.slots)

    @property
    def size(self) -> int:
        """Places in the buffer, at least one."""
        return max(1, len(self.variables) + 2 * len(self.slots))

    def of(self, component: str, causality: str) -> list[Port]:
        """Inputs or outputs of a component, in the order of the buffer."""
        return [p for p, v in self.variables.items() if p.component == component and v.causality == causality]

    def spoken(self, component: str, causality: str) -> list[Port]:
        """String inputs or outputs of a component."""
        return [p for p, v in self.texts.items() if p.component == component and v.causality == causality]

    def variable(self, port: Port) -> Variable:
        """The variable of a port of any type."""
        return self.texts[port] if port in self.texts else self.variables[port]


class Exchange(NamedTuple):
    """One call that moves Real values, with its arguments ready as ctypes objects."""

    function: str  # that an error names; empty where there are no values to move
    entry: Callable[..., int]
    references: Any
    values: Any
    arguments: tuple[Any, ...]


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


def nothing(*_: object) -> int:
    """Stands for the entry point where there are no values to move."""
    return 0


class Part:
    """One component of a run: connections into it, exchange with the buffer, and its step."""

    def __init__(self, component: Component, instance: Instance, buffer: array[float], places: Layout) -> None:
        self.component, self.instance, self.buffer, self.places = component, instance, buffer, places
        self.outputs = places.of(component.name, "output")
        self.plain: list[tuple[int, int]] = []
        self.scaled: list[tuple[int, int, float, float]] = []
        self.stages = {name: Stage(slot) for name, slot in places.slots_of(component.name).items()}
        self.is_played = False  # an input follows a signal of the scenario
        self.status = self.warnings = 0  # of the last call; steps that returned a warning
        self.ended = 0  # what its orderly end was, if it has ended
        self.prepare()

    def prepare(self) -> None:
        """Make ready the calls that move values."""
        self.set_inputs = self.exchange("Set", self.places.of(self.component.name, "input"))
        self.get_outputs = self.exchange("Get", self.outputs)

    @property
    def is_direct(self) -> bool:
        """True if C may call the FMU without Python."""
        return self.instance.is_near

    @property
    def follows(self) -> bool:
        """True if an input may change during a run."""
        return bool(self.plain or self.scaled or self.stages or self.is_played)

    def number(self, name: str, value: Value | None) -> Value | None:
        """A value for a variable as FMI takes it."""
        return None if value is None else self.instance.description.variables[name].number(value)

    def exchange(self, action: str, ports: list[Port]) -> Exchange:
        """Entry point and arguments of one call that moves the values of all these ports between buffer and FMU."""
        variables, count = [self.places.variables[port] for port in ports], len(ports)
        first = self.places.index[ports[0]] if ports else 0
        references = referring(variables)
        values = (ctypes.c_double * count).from_buffer(self.buffer, 8 * first)
        length, after = ctypes.c_size_t(len(references)), self.instance.after(count)
        arguments = (self.instance.pointer, references, length, values, *after)
        function = self.instance.accessor(action, variables[0]) if ports else ""
        entry = self.instance.function(function) if ports else nothing
        return Exchange(function=function, entry=entry, references=references, values=values, arguments=arguments)

    def connect(self, connection: Connection) -> None:
        """Let an input follow an output from now on."""
        target, source = self.places.inlets[connection.target], self.places.index[connection.source]
        if connection.converts:
            factor = 1.0 if connection.factor is None else connection.factor
            self.scaled.append((target, source, factor, connection.bias or 0.0))
        else:
            self.plain.append((target, source))

    def taker(self) -> Callable[[], str]:
        """Function that copies connected outputs into the inputs and sets these; returns what failed, or nothing."""
        copy, (function, entry, _, _, arguments) = self.copier(), self.set_inputs

        def take() -> str:
            copy()
            status = entry(*arguments)
            return self.checked(status, function) if status > WARNING else ""

        return take

    def copier(self) -> Callable[[], None]:
        """Function that copies connected outputs into the inputs."""
        buffer, plain, scaled, stages = self.buffer, tuple(self.plain), tuple(self.scaled), tuple(self.stages.values())

        def copy() -> None:
            for target, source in plain:
                buffer[target] = buffer[source]
            for target, source, factor, bias in scaled:
                buffer[target] = factor * buffer[source] + bias
            for stage in stages:
                value = buffer[stage.source]
                buffer[stage.slot.after] = stage.factor * value + stage.bias if stage.converts else value

        return copy

    def read_outputs(self) -> str:
        """Read the outputs into the buffer; what failed, or nothing."""
        call = self.get_outputs
        failed = self.checked(call.entry(*call.arguments), call.function)
        return failed or ("" if all(map(math.isfinite, self.values())) else NOT_FINITE)

    def values(self) -> memoryview:
        """The outputs in the buffer."""
        first = self.places.index[self.outputs[0]] if self.outputs else 0
        return memoryview(self.buffer)[first : first + len(self.outputs)]

    def checked(self, status: int, function: str) -> str:
        """Nothing for a good status; otherwise the function's name, and the status is kept for the message."""
        self.status = status
        return function if status > WARNING else ""

    def stepper(self, base_step: float, takes_inputs: bool) -> Stepper:
        """Function of the start time that does one step and reads the outputs; returns what failed, or nothing.

        For Gauss-Seidel the inputs are taken first, unless nothing is connected to them: then they never change.
        """
        take = self.taker() if takes_inputs and self.follows else None
        do = self.instance.doer(self.component.step * base_step)
        get, function, arguments = self.get_outputs.entry, self.get_outputs.function, self.get_outputs.arguments
        outputs, is_finite, warning = self.values(), math.isfinite, WARNING

        def step(start: float) -> str:
            if take:
                failed = take()
                if failed:
                    return failed
            status = do(start)
            if status and not self.has_stepped(status):
                return self.checked(status, STEP)
            status = get(*arguments)
            if status > warning:
                return self.checked(status, function)
            return "" if is_finite(sum(outputs)) or all(map(is_finite, outputs)) else NOT_FINITE

        return step

    def has_stepped(self, status: int) -> bool:
        """True for the status of a step that was done, with a warning or as the last one."""
        self.warnings += status == WARNING
        return status <= WARNING or self.has_ended(status)

    def has_ended(self, status: int) -> bool:
        """True for the status of the orderly end of the component, which is kept."""
        self.ended = status if status in (ENDS, ENDS_WITHIN) else 0
        return self.ended > 0

    def failure(self, what: str, time: float, index: int) -> FmuError:
        """Error for what a step returned."""
        if what != NOT_FINITE:
            return self.instance.failure(what, self.status, time, index)
        bad = [f"`{p.variable}` is {v}" for p, v in zip(self.outputs, self.values()) if not math.isfinite(v)]
        cause = f"output {', '.join(bad)}. Look at its inputs and parameters{self.instance.said()}."
        return FmuError(self.component.name, cause, time=time, step=index, log=self.instance.log())
