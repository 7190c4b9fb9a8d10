"""The process of one FMU instance, seen from inside."""

from __future__ import annotations

import atexit
import ctypes
import mmap
import os
import pickle
from base64 import b64decode, b64encode
from collections.abc import Callable, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.fmu.instance import ENDS, ENDS_WITHIN, ERROR, GET, SET, STEP, WARNING, Instance, Message
from gapsense.cosim.fmu.instance3 import Instance3
from gapsense.cosim.run.failure import FmuError

OK = 0
Request = tuple[str, Any, bool]  # verb, its arguments, whether the inputs are new
Answer = tuple[int, str, Any, list[Message]]  # status, entry point that gave it, value, new messages


class Memory(NamedTuple):
    """Inputs and outputs that two processes share, as arrays of ctypes."""

    inputs: Any
    outputs: Any


def memory(folder: Path, description: Description, is_new: bool = False) -> Memory:
    """Inputs and outputs of a component, in a file."""
    sizes = [len(references(description, causality)) for causality in ("input", "output")]
    file = folder / "values"
    if is_new:
        file.write_bytes(bytes(8 * sum(sizes) + 8))  # nothing cannot be mapped
    with file.open("r+b") as opened:
        shared = mmap.mmap(opened.fileno(), 0)
    first, second = (ctypes.c_double * size for size in sizes)
    return Memory(first.from_buffer(shared), second.from_buffer(shared, 8 * sizes[0]))


def references(description: Description, causality: str) -> list[int]:
    """Value references of the Real inputs or outputs, in the order in which the master has them."""
    return [variable.reference for variable in description.of(causality) if variable.type == "Real"]


def plain(values: Any) -> list[Any]:
    """Values of an array of ctypes, as JSON takes them."""
    return [value.decode("utf-8", "replace") if isinstance(value, bytes) else value for value in values]


def raw(values: Sequence[Any]) -> list[Any]:
    """The same, as an array of ctypes takes them."""
    return [value.encode("utf-8") if isinstance(value, str) else value for value in values]


class Noting(Instance):
    """An instance that remembers which call failed."""

    failed, status = "", 0

    def failure(self, function: str, status: int, time: float | None = None, step: int | None = None) -> FmuError:
        """Error for a call that failed."""
        self.failed, self.status = function, status
        return super().failure(function, status, time, step)


class Noting3(Noting, Instance3):
    """The same of FMI 3.0."""


def prepare(folder: str) -> Callable[[Request], Answer]:
    """Function that does what the master asks of the instance whose plan is in a folder."""
    import fmpy.fmi2  # noqa: F401  # now, so that it does not count for the component

    return Server(Path(folder)).answer


class Server:
    """The instance, once it is loaded, and what may be asked of it."""

    instance: Noting

    def __init__(self, folder: Path) -> None:
        plan: tuple[str, Description, Path] = pickle.loads((folder / "plan").read_bytes())
        self.name, self.description, self.extracted = plan
        self.memory = memory(folder, self.description)
        self.process = os.getpid()
        self.last: Message | None = None  # that was passed on
        self.doers: dict[float, Callable[[float], int]] = {}  # by duration
        self.inputs, self.outputs = (self.arguments(c, v) for c, v in zip(("input", "output"), self.memory))

    def arguments(self, causality: str, values: Any) -> tuple[Any, ...]:
        """What the calls that move inputs or outputs take."""
        numbers = references(self.description, causality)
        return (ctypes.c_uint * len(numbers))(*numbers), ctypes.c_size_t(len(numbers)), values

    def answer(self, request: Request) -> Answer:
        """Answer one request; a failed call is an answer too."""
        verb, arguments, is_set = request
        if verb == "load":
            return self.load()
        self.instance.failed, self.instance.status = "", 0
        try:
            if is_set and len(self.memory.inputs):
                self.instance.call(SET, *self.inputs)
            value = self.do(verb, arguments)
        except FmuError:
            return self.instance.status, self.instance.failed, self.instance.last, self.said()
        return self.instance.status, "", value, self.said()

    def load(self) -> Answer:
        """Load the FMU; the entry point in the answer is the whole cause if that fails."""
        try:
            kind = Noting3 if self.description.fmi == 3 else Noting
            self.instance = kind(self.name, self.description, self.extracted)
        except FmuError as error:
            return ERROR, error.cause, None, []
        atexit.register(self.instance.close)
        return 0, "", None, self.said()

    def do(self, verb: str, arguments: Any) -> Any:
        """What a verb means; None where there is nothing to answer."""
        instance = self.instance
        if verb in (STEP, "do"):
            self.step(*arguments)
        if verb in (STEP, GET) and len(self.memory.outputs):
            instance.call(GET, *self.outputs)
        if verb in (STEP, "do", GET):
            return instance.last
        if verb == "move":
            return self.move(*arguments)
        if verb == "state":
            return b64encode(instance.state()).decode()
        others: dict[str, Callable[[], None]] = {
            "call": lambda: instance.call(arguments),
            "initialize": lambda: instance.initialize(*arguments),
            "restore": lambda: instance.restore(b64decode(arguments)),
        }
        return others[verb]()

    def move(self, action: str, names: list[str], values: list[Any]) -> list[Any] | None:
        """Set values of variables of one type, or get them."""
        array = self.instance.move(action, [self.description.variables[name] for name in names], raw(values))
        return plain(array) if action == "Get" else None

    def step(self, start: float, duration: float) -> None:
        """Do a step, and nothing else; its status is that of the answer."""
        if duration not in self.doers:
            self.doers[duration] = self.instance.doer(duration)
        status = self.doers[duration](start)
        if os.getpid() != self.process:
            os._exit(0)  # a fork that the component made: it shares the memory of the outputs, and comes later
        if status not in (OK, WARNING, ENDS, ENDS_WITHIN):
            raise self.instance.failure(STEP, status)
        self.instance.status = status

    def said(self) -> list[Message]:
        """Messages since the last answer."""
        new = list(takewhile(lambda message: message is not self.last, reversed(self.instance.messages)))[::-1]
        self.last = new[-1] if new else self.last
        return new
