"""One FMU instance: life cycle and parameters, with errors that carry the component's own words."""

from __future__ import annotations

import ctypes
import re
import shutil
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from gapsense import locks
from gapsense.cosim.descriptions import Description, Variable
from gapsense.cosim.record import FmuError
from gapsense.tables import Value

STATUS = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
LONGEST = 500  # characters of a message shown in an error; its `log` has all
KEPT = 1000  # log messages per instance; the oldest are dropped
PLAIN = re.compile(r"[A-Za-z0-9_./:\\~-]+")
C_TYPES: Mapping[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Enumeration": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}


class Message(NamedTuple):
    """What a component logged at one time."""

    status: int
    text: str


def temporary_folder() -> Path:
    """A new folder with a plain ASCII path: FMUs may fail on any other, see section 1 of hosts.md."""
    for base in (None, Path("/tmp"), Path()):
        folder = locks.temporary_folder(base).resolve()
        if PLAIN.fullmatch(str(folder)):
            return folder
        shutil.rmtree(folder)
    raise FmuError("fmus", "no temporary folder has a plain ASCII path. Set TMPDIR to one that has.")


def collector(messages: deque[Message]) -> Callable[..., None]:
    """Function for the logger of an FMU that keeps its messages."""

    def log(_: Any, instance: bytes, status: int, category: bytes | None, text: bytes | None) -> None:
        messages.append(Message(status, (text or b"").decode("utf-8", "replace").replace("%%", "%")))

    return log


class Instance:
    """An FMU loaded as `name` from its extracted `folder`. After `fmi2Fatal` it is never touched again."""

    def __init__(self, name: str, description: Description, folder: Path) -> None:
        from fmpy import calloc, fmi2, free  # here, so that what loads no FMU starts fast

        self.name, self.description = name, description
        self.messages: deque[Message] = deque(maxlen=KEPT)
        self.is_dead = self.is_used = False
        callbacks = fmi2.fmi2CallbackFunctions(  # the slave keeps them alive
            logger=fmi2.fmi2CallbackLoggerTYPE(collector(self.messages)),
            allocateMemory=fmi2.fmi2CallbackAllocateMemoryTYPE(calloc),
            freeMemory=fmi2.fmi2CallbackFreeMemoryTYPE(free),
        )
        try:
            self.slave = fmi2.FMU2Slave(
                guid=description.guid,
                modelIdentifier=description.identifier,
                unzipDirectory=str(folder),
                instanceName=name,
            )
            self.slave.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:  # fmpy raises plain Exception for a library that does not load
            raise FmuError(name, f"cannot be instantiated: {error}{self.said()}.", log=self.log()) from error
        self.pointer = ctypes.c_void_p(self.slave.component)

    def function(self, name: str) -> Callable[..., int]:
        """Raw entry point, to be called with ctypes objects only: several times faster than fmpy's methods."""
        entry: Callable[..., int] = self.slave.dll[name]
        return entry

    def call(self, function: str, *arguments: Any) -> None:
        """Call an entry point and raise FmuError if it fails."""
        status = self.function(function)(self.pointer, *arguments)
        if status > WARNING:
            raise self.failure(function, status)

    def failure(self, function: str, status: int, time: float | None = None, step: int | None = None) -> FmuError:
        """Error for a call that failed; the instance counts as dead if it said `fmi2Fatal`."""
        self.is_dead = self.is_dead or status >= FATAL
        word = STATUS[status] if 0 <= status < len(STATUS) else f"status {status}"
        return FmuError(self.name, f"{function} returned {word}{self.said()}.", time=time, step=step, log=self.log())

    def said(self) -> str:
        """What the component logged about a failure, in one line, to end a sentence with.

        Its own words have status discard or error; after an exception pythonfmu adds a fatal one that often knows less.
        """
        own = [m.text for m in self.messages if m.status in (DISCARD, ERROR)]
        texts = own or [m.text for m in self.messages if m.status == FATAL] or [m.text for m in self.messages]
        lines = dict.fromkeys(summary(text).rstrip(".") for text in texts[-3:])
        return f"; the component says: {'; '.join(lines)}" if lines else "; the component says nothing about it"

    def log(self) -> str:
        """Everything logged, oldest first."""
        return "\n".join(message.text for message in self.messages)

    def initialize(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Set parameters and enter initialization mode; a used instance is reset first, which equals a fresh one."""
        if self.is_used:
            self.messages.clear()
            self.call("fmi2Reset")
        self.is_used = True
        yes, no, none = ctypes.c_int(1), ctypes.c_int(0), ctypes.c_double(0.0)
        self.call("fmi2SetupExperiment", no, none, ctypes.c_double(start), yes, ctypes.c_double(stop))
        for name, value in values.items():
            self.set(self.description.variables[name], value)
        self.call("fmi2EnterInitializationMode")

    def set(self, variable: Variable, value: Value) -> None:
        """Set one variable of any type."""
        raw = str(value).encode("utf-8") if variable.type == "String" else value
        self.exchange("fmi2Set", variable, (C_TYPES[variable.type] * 1)(raw))

    def get(self, variable: Variable) -> Value:
        """Read one variable of any type."""
        buffer = (C_TYPES[variable.type] * 1)()
        self.exchange("fmi2Get", variable, buffer)
        value = buffer[0]
        if variable.type == "String":
            return (value or b"").decode("utf-8", "replace")
        return bool(value) if variable.type == "Boolean" else value

    def exchange(self, function: str, variable: Variable, buffer: Any) -> None:
        """Call the entry point that moves a value of this variable's type."""
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        self.call(function + kind, (ctypes.c_uint * 1)(variable.reference), ctypes.c_size_t(1), buffer)

    def close(self) -> None:
        """Free the instance and its library, unless it is dead."""
        if not self.is_dead:
            self.is_dead = True
            self.slave.freeInstance()


def summary(text: str) -> str:
    """One line for a logged text: of one with a traceback only what stands before it and its last line."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    start = next((i for i, line in enumerate(lines) if line.startswith("Traceback (")), None)
    words = " ".join(lines if start is None else [*lines[:start], lines[-1]])
    return words[:LONGEST] or "(empty message)"
