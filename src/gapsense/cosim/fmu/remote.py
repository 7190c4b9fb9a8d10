"""An FMU instance in a process of its own, which the master uses as if it were in this one.

Real inputs and outputs are in memory that both processes share.  A step is one request: it sets the inputs if they are
new, steps, and reads the outputs, by the same calls and in the same order as in this process.
"""

from __future__ import annotations

import atexit
import ctypes
import math
import mmap
import os
import pickle
from base64 import b64decode, b64encode
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from threading import Event, Thread
from typing import Any, NamedTuple

from gapsense._os.processes import Died, process
from gapsense.cosim.fmu.descriptions import Description, Variable
from gapsense.cosim.fmu.instance import (
    ENDS,
    ENDS_WITHIN,
    ERROR,
    FATAL,
    GET,
    KEPT,
    SET,
    SLOPE,
    STEP,
    WARNING,
    Instance,
    Instance3,
    Message,
    instance_of,
)
from gapsense.problems import FmuError
from gapsense.tables import Value

OK = 0
Request = tuple[str, Any, bool]  # verb, its arguments, whether the inputs are new
Answer = tuple[int, str, Any, list[Message]]  # status, entry point that gave it, value, new messages


class RemoteInstance(Instance):
    """An FMU loaded as `name` from its extracted `folder` elsewhere; `limit` [s] is for each answer from there."""

    is_near = False

    def __init__(self, name: str, description: Description, folder: Path, limit: float) -> None:
        self.name, self.description, self.pointer = name, description, ctypes.c_void_p()
        self.messages: deque[Message] = deque(maxlen=KEPT)
        self.is_dead = self.is_used = self.is_set = self.is_read = False
        self.cause = ""  # how the process has ended
        self.process, self.ended = process(limit=limit), Event()
        home = self.process.folder
        (home / "plan").write_bytes(pickle.dumps((name, description, folder)))
        try:
            self.memory = memory(home, description, is_new=True)
            Thread(target=self.watch, daemon=True).start()
            self.process.prepare(prepare, str(home))
            if self.request("load")[0] > WARNING:
                raise self.error(self.cause or self.failed)
        except BaseException:
            self.close()
            raise

    def watch(self) -> None:
        """End the process when it hangs."""
        while not self.ended.wait(min(0.1, (self.process.limit or 1.0) / 4)):
            self.process.check()

    def request(self, verb: str, arguments: Any = None) -> tuple[int, Any]:
        """Status and answer of the other process, after taking over what the component has logged."""
        if self.is_dead:
            return FATAL, None
        try:
            status, self.failed, answer, said = self.process.ask([verb, arguments, self.is_set], verb)
        except Died as died:
            self.is_dead, self.cause = True, died.cause
            self.messages.append(Message(FATAL, died.words or "(nothing)"))
            return FATAL, None
        self.is_set, self.is_read = False, verb in (STEP, GET)
        self.messages.extend(Message(*message) for message in said)
        return status, answer

    def require(self, verb: str, arguments: Any = None) -> Any:
        """Return the answer to a request that has to succeed."""
        status, answer = self.request(verb, arguments)
        if status > WARNING:
            raise self.failure(verb, status)
        return answer

    @property
    def has_only_reals(self) -> bool:
        """True if memory that is shared holds all inputs and outputs."""
        return self.description.fmi == 2 and super().has_only_reals

    def function(self, name: str) -> Callable[..., int]:
        """What stands for an entry point here; only those that the master calls itself."""
        return lambda _: self.request("call", [name])[0]

    def mover(self, action: str, variables: Sequence[Variable], values: Any) -> Callable[[], int]:
        """Function that gets or sets the values of variables of one type, an array, and returns the status."""
        names, size = [variable.name for variable in variables], ctypes.sizeof(values)
        shared = {name: self.description.of(c) for name, c in (("Set", "input"), ("Get", "output"))}[action]

        def give() -> int:  # to where the next request finds the inputs
            ctypes.memmove(self.memory.inputs, values, size)
            self.is_set = True
            return 0

        def take() -> int:  # from where the last step left the outputs, or ask for them
            status = 0 if self.is_read else self.request(GET)[0]
            ctypes.memmove(values, self.memory.outputs, size)
            return status

        if self.has_only_reals and names == [variable.name for variable in shared]:
            return give if action == "Set" else take

        def move() -> int:
            status, answer = self.request("move", [action, names, plain(values)])
            if status <= WARNING and action == "Get":
                values[:] = raw(answer)
            return status

        return move

    def sloper(self, variables: Sequence[Variable], slopes: Any) -> Callable[[], int]:
        """Function that tells how Real inputs go on in the next step, by an array [1/s], and returns the status."""
        names = [variable.name for variable in variables]
        return lambda: self.request("slope", [names, plain(slopes)])[0]

    def doer(self, duration: float) -> Callable[[float], int]:
        """Function of the start time that sets new inputs, does a step, reads Real outputs, and returns the status."""
        verb = STEP if self.has_only_reals else "do"

        def do(start: float) -> int:
            status, last = self.request(verb, [start, duration])
            self.last = math.nan if last is None else last
            return status

        return do

    def failure(self, function: str, status: int, time: float | None = None, step: int | None = None) -> FmuError:
        """Error for a call that failed, or ended the process."""
        if self.cause:
            return self.error(f"{self.cause}, {'in its step' if step else f'in `{function}`'}.", time, step)
        return super().failure(self.failed or function, status, time, step)

    def initialize(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Set parameters and enter initialization mode; a used instance is reset first."""
        if self.is_used:
            self.messages.clear()
        self.is_used, self.is_set = True, False
        self.require("initialize", [dict(values), start, stop])

    def state(self) -> bytes:
        """All that the instance remembers."""
        return b64decode(self.require("state"))

    def restore(self, saved: bytes) -> None:
        """Remember what another instance of the same FMU did."""
        self.require("restore", b64encode(saved).decode())

    def hold(self, name: str) -> None:
        """Keep the state as it is now under a name, for `back`."""
        self.require("hold", [name])

    def back(self, name: str) -> None:
        """Go back to the state that is held under this name."""
        self.require("back", [name])

    def close(self) -> None:
        """Free the instance, and end its process."""
        self.is_dead = True
        self.ended.set()
        self.process.close()


class RemoteInstance3(RemoteInstance, Instance3):
    """The same for an FMU of FMI 3.0."""


# The process of one FMU instance, seen from inside.


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


def prepare(folder: str) -> Callable[[Request], Answer]:
    """Function that does what the master asks of the instance whose plan is in a folder."""
    return Server(Path(folder)).answer


class Server:
    """The instance, once it is loaded, and what may be asked of it."""

    instance: Instance

    def __init__(self, folder: Path) -> None:
        plan: tuple[str, Description, Path] = pickle.loads((folder / "plan").read_bytes())
        self.name, self.description, self.extracted = plan
        self.memory = memory(folder, self.description)
        self.process = os.getpid()
        self.last: Message | None = None  # that was passed on
        self.doers: dict[float, Callable[[float], int]] = {}  # by duration
        known = (references(self.description, causality) for causality in ("input", "output"))
        arrays = ((ctypes.c_uint * len(numbers))(*numbers) for numbers in known)
        # What the calls that move them take:
        self.inputs, self.outputs = ((a, ctypes.c_size_t(len(a)), values) for a, values in zip(arrays, self.memory))

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
            self.instance = instance_of(self.name, self.description, self.extracted)
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
        if verb in ("slope", "move"):
            return getattr(self, verb)(*arguments)
        if verb == "state":
            return b64encode(instance.state()).decode()
        if verb == "restore":
            return instance.restore(b64decode(arguments))
        return getattr(instance, verb)(*arguments)  # call, initialize, hold, back

    def move(self, action: str, names: list[str], values: list[Any]) -> list[Any] | None:
        """Set values of variables of one type, or get them."""
        array = self.instance.move(action, [self.description.variables[name] for name in names], raw(values))
        return plain(array) if action == "Get" else None

    def slope(self, names: list[str], slopes: list[float]) -> None:
        """Tell how Real inputs go on in the next step."""
        variables = [self.description.variables[name] for name in names]
        status = self.instance.sloper(variables, (ctypes.c_double * len(names))(*slopes))()
        if status > WARNING:
            raise self.instance.failure(SLOPE, status)

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
