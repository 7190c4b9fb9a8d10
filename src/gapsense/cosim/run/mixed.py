"""A component inside the master that has more than Real variables: moved by Python, type by type."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

from gapsense.cosim.fmu.instance import STEP, WARNING, Instance
from gapsense.cosim.fmu.variables import Variable
from gapsense.cosim.run.failure import FmuError
from gapsense.cosim.run.part import NOT_FINITE, Layout, Part, Stepper
from gapsense.cosim.scenario.elements import Component, Connection, Port

Texts = dict[Port, str]  # values of String variables, as the buffer holds those of all others
NOT_FITTING = "not fitting"
EXACT = 2**53  # up to here every whole number is a double


def part_of(component: Component, instance: Instance, buffer: array[float], places: Layout, texts: Texts) -> Part:
    """The component as a part of a run."""
    if instance.has_only_reals:
        return Part(component, instance, buffer, places)
    return MixedPart(component, instance, buffer, places, texts)


class Channel:
    """Variables of one type of an FMU that move in one call: their array, and the places that these values have."""

    def __init__(self, instance: Instance, action: str, ports: Sequence[Port], places: Layout) -> None:
        variables = [places.variable(port) for port in ports]
        self.kind, self.range = variables[0].type, variables[0].range
        self.function = instance.accessor(action, variables[0])
        self.values = (instance.c_type(variables[0]) * len(ports))()
        self.move = instance.mover(action, variables, self.values)
        self.ports = tuple(ports)
        self.places = [] if self.kind == "String" else [places.index[port] for port in ports]

    def fill(self, buffer: array[float], texts: Texts) -> str:
        """Take the values for the FMU; what is wrong with one, or nothing."""
        values, kind = self.values, self.kind
        if kind == "String":
            values[:] = [texts[port].encode("utf-8") for port in self.ports]
        elif self.range is None:
            values[:] = [buffer[place] for place in self.places] if kind == "Real" else self.truths(buffer)
        else:
            low, high = self.range
            for j, place in enumerate(self.places):
                if not low <= buffer[place] <= high:
                    return f"input `{self.ports[j].variable}` gets {buffer[place]:.17g}, {low} to {high} expected"
                values[j] = int(buffer[place])
        return ""

    def truths(self, buffer: array[float]) -> list[bool]:
        """Values of Boolean variables."""
        return [buffer[place] != 0.0 for place in self.places]

    def empty(self, buffer: array[float], texts: Texts) -> str:
        """Keep the values that the FMU gave; what is wrong with one, or nothing."""
        if self.kind == "String":
            texts.update(
                (port, (value or b"").decode("utf-8", "replace")) for port, value in zip(self.ports, self.values)
            )
            return ""
        for port, place, value in zip(self.ports, self.places, self.values):
            if self.kind == "Real" and not math.isfinite(value):
                return f"output `{port.variable}` is {value}. Look at its inputs and parameters"
            if self.range and abs(value) > EXACT:
                return f"output `{port.variable}` is {value}; beyond 2**53 numbers are not kept exactly"
            buffer[place] = value
        return ""


def channels(instance: Instance, action: str, ports: Sequence[Port], places: Layout) -> Iterator[Channel]:
    """Channels for all these ports, one for each type."""

    def type_of(port: Port) -> str:
        variable: Variable = places.variable(port)
        return variable.size or variable.type

    for _, alike in groupby(sorted(ports, key=type_of), key=type_of):
        yield Channel(instance, action, list(alike), places)


class MixedPart(Part):
    """As `Part`, for variables of all types."""

    is_direct = False

    def __init__(
        self, component: Component, instance: Instance, buffer: array[float], places: Layout, texts: Texts
    ) -> None:
        self.texts, self.spoken, self.problem = texts, list[tuple[Port, Port]](), ""
        super().__init__(component, instance, buffer, places)

    def prepare(self) -> None:
        """Make ready the calls that move values."""
        name, places = self.component.name, self.places
        spoken = {causality: places.spoken(name, causality) for causality in ("input", "output")}
        self.givers = [*channels(self.instance, "Set", [*places.of(name, "input"), *spoken["input"]], places)]
        self.readers = [*channels(self.instance, "Get", [*self.outputs, *spoken["output"]], places)]

    @property
    def follows(self) -> bool:
        """True if an input may change during a run."""
        return super().follows or bool(self.spoken)

    def connect(self, connection: Connection) -> None:
        """Let an input follow an output from now on."""
        if connection.target in self.places.index:
            super().connect(connection)
        else:
            self.spoken.append((connection.target, connection.source))

    def taker(self) -> Callable[[], str]:
        """Function that copies connected outputs into the inputs and sets these; returns what failed, or nothing."""
        buffer, texts, spoken, givers = self.buffer, self.texts, tuple(self.spoken), tuple(self.givers)
        copy = self.copier()

        def take() -> str:
            copy()
            for heard, said in spoken:
                texts[heard] = texts[said]
            for channel in givers:
                self.problem = channel.fill(buffer, texts)
                if self.problem:
                    return NOT_FITTING
                status = channel.move()
                if status > WARNING:
                    return self.checked(status, channel.function)
            return ""

        return take

    def read_outputs(self) -> str:
        """Read the outputs; what failed, or nothing."""
        for channel in self.readers:
            status = channel.move()
            if status > WARNING:
                return self.checked(status, channel.function)
            self.problem = channel.empty(self.buffer, self.texts)
            if self.problem:
                return NOT_FITTING
        return ""

    def stepper(self, base_step: float, takes_inputs: bool) -> Stepper:
        """Function of the start time that does one step and reads the outputs; returns what failed, or nothing."""
        take = self.taker() if takes_inputs and self.follows else None
        do, read = self.instance.doer(self.component.step * base_step), self.read_outputs

        def step(start: float) -> str:
            failed = take() if take else ""
            if failed:
                return failed
            status = do(start)
            return read() if self.has_stepped(status) else self.checked(status, STEP)

        return step

    def failure(self, what: str, time: float, index: int) -> FmuError:
        """Error for what a step returned."""
        if what not in (NOT_FITTING, NOT_FINITE):
            return super().failure(what, time, index)
        cause = f"{self.problem}."
        return FmuError(self.component.name, cause, time=time, step=index, log=self.instance.log())
