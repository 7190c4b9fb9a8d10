"""An FMU instance in a process of its own, which the master uses as if it were in this one.

Real inputs and outputs are in memory that both processes share.  A step is one request: it sets the inputs if they are
new, steps, and reads the outputs, by the same calls and in the same order as in this process.
"""

from __future__ import annotations

import ctypes
import math
import pickle
from base64 import b64decode, b64encode
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Event, Thread
from typing import Any

from gapsense._os.prestart import process
from gapsense._os.processes import Died
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.fmu.instance import FATAL, GET, KEPT, SET, STEP, WARNING, Instance, Message
from gapsense.cosim.fmu.instance3 import kind_of
from gapsense.cosim.fmu.remote_child import memory, plain, prepare, raw
from gapsense.cosim.fmu.variables import Variable
from gapsense.cosim.run.failure import FmuError
from gapsense.tables import Value


class RemoteInstance(Instance):
    """An FMU loaded as `name` from its extracted `folder` elsewhere; `limit` [s] is for each answer from there."""

    is_near = False
    kind: type[Instance]

    def __init__(self, name: str, description: Description, folder: Path, limit: float) -> None:
        self.name, self.description, self.pointer = name, description, ctypes.c_void_p()
        self.kind = kind_of(description)
        self.messages: deque[Message] = deque(maxlen=KEPT)
        self.is_dead = self.is_used = self.is_set = self.is_read = False
        self.failed = self.cause = ""  # the entry point that failed last; how the process has ended
        self.process, self.ended = process(limit=limit), Event()
        home = self.process.folder
        (home / "plan").write_bytes(pickle.dumps((name, description, folder)))
        try:
            self.memory = memory(home, description, is_new=True)
            Thread(target=self.watch, daemon=True).start()
            self.process.prepare(prepare, str(home))
            if self.request("load")[0] > WARNING:
                raise FmuError(name, self.cause or self.failed, log=self.log())
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

    def wanted(self, verb: str, arguments: Any = None) -> Any:
        """The answer to a request that has to succeed."""
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
        named: dict[str, Callable[..., int]] = {SET: self.set_inputs, GET: self.get_outputs}
        return named.get(name, lambda _: self.request("call", name)[0])

    def set_inputs(self, _: Any, references: Any, count: ctypes.c_size_t, values: Any) -> int:
        """Leave the inputs where the next request finds them."""
        ctypes.memmove(self.memory.inputs, values, 8 * count.value)
        self.is_set = True
        return 0

    def get_outputs(self, _: Any, references: Any, count: ctypes.c_size_t, values: Any) -> int:
        """Take the outputs from where the last step left them, or ask for them."""
        status = 0 if self.is_read else self.request(GET)[0]
        ctypes.memmove(values, self.memory.outputs, 8 * count.value)
        return status

    def entry(self, function: str) -> str:
        """Name that the FMU's version of FMI has for an entry point of FMI 2.0."""
        return self.kind.entry(self, function)

    def c_type(self, variable: Variable) -> Any:
        """Type of C that a variable has."""
        return self.kind.c_type(self, variable)

    def accessor(self, action: str, variable: Variable) -> str:
        """Entry point that gets or sets values of this variable's type."""
        return self.kind.accessor(self, action, variable)

    def mover(self, action: str, variables: Sequence[Variable], values: Any) -> Callable[[], int]:
        """Function that gets or sets the values of variables of one type, an array, and returns the status."""
        names = [variable.name for variable in variables]

        def move() -> int:
            status, answer = self.request("move", [action, names, plain(values)])
            if status <= WARNING and action == "Get":
                values[:] = raw(answer)
            return status

        return move

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
            where = "in its step" if step else f"in `{function}`"
            return FmuError(self.name, f"{self.cause}, {where}.", time=time, step=step, log=self.log())
        return super().failure(self.failed or function, status, time, step)

    def initialize(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Set parameters and enter initialization mode; a used instance is reset first."""
        if self.is_used:
            self.messages.clear()
        self.is_used, self.is_set = True, False
        self.wanted("initialize", [dict(values), start, stop])

    def state(self) -> bytes:
        """All that the instance remembers."""
        return b64decode(self.wanted("state"))

    def restore(self, saved: bytes) -> None:
        """Remember what another instance of the same FMU did."""
        self.wanted("restore", b64encode(saved).decode())

    def close(self) -> None:
        """Free the instance, and end its process."""
        self.is_dead = True
        self.ended.set()
        self.process.close()
