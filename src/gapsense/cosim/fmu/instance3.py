"""One instance of an FMU of FMI 3.0; everything but the differences to FMI 2.0 is in `instance.py`."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.fmu.instance import STEP, WARNING, Instance, Message, reached
from gapsense.cosim.fmu.variables import Variable
from gapsense.tables import Value

C_TYPES: Mapping[str, Any] = {
    "Float64": ctypes.c_double,
    "Float32": ctypes.c_float,
    **{f"{s}Int{n}": getattr(ctypes, f"c_{s.lower()}int{n}") for s in ("", "U") for n in (8, 16, 32, 64)},
    "Enumeration": ctypes.c_int64,
    "Boolean": ctypes.c_bool,
    "String": ctypes.c_char_p,
}


def instance_of(name: str, description: Description, folder: Path) -> Instance:
    """An FMU of either version, loaded as `name` from its unpacked `folder`."""
    return kind_of(description)(name, description, folder)


def kind_of(description: Description) -> type[Instance]:
    """What stands for instances of an FMU of its version."""
    return Instance3 if description.fmi == 3 else Instance


def collector(messages: deque[Message]) -> Callable[..., None]:
    """Function for the logger of an FMU that keeps its messages."""

    def log(_: Any, status: int, category: bytes | None, text: bytes | None) -> None:
        messages.append(Message(status, (text or b"").decode("utf-8", "replace")))

    return log


class Instance3(Instance):
    """An FMU of FMI 3.0, without event mode, early return and clocks."""

    def instantiated(self, folder: Path) -> Any:
        """What fmpy makes of the library."""
        from fmpy import fmi3  # here, so that what loads no FMU starts fast

        slave = fmi3.FMU3Slave(
            guid=self.description.guid,
            modelIdentifier=self.description.identifier,
            unzipDirectory=str(folder),
            instanceName=self.name,
        )
        slave.instantiate(loggingOn=True, logMessage=collector(self.messages))
        return slave

    def entry(self, function: str) -> str:
        """Name that FMI 3.0 has for an entry point or a status of FMI 2.0."""
        return function.replace("fmi2", "fmi3", 1).replace("FMUstate", "FMUState").replace("DeSer", "Deser")

    def enter(self, values: Mapping[str, Value], start: float, stop: float) -> None:
        """Everything before and at the start of the initialization mode."""
        yes, no, none = ctypes.c_bool(True), ctypes.c_bool(False), ctypes.c_double(0.0)
        sizes = {name: value for name, value in values.items() if self.description.variables[name].is_structural}
        if sizes:
            self.call("fmi2EnterConfigurationMode")
            self.set_all(sizes)
            self.call("fmi2ExitConfigurationMode")
        self.set_all({name: value for name, value in values.items() if name not in sizes})
        self.call("fmi2EnterInitializationMode", no, none, ctypes.c_double(start), yes, ctypes.c_double(stop))

    def c_type(self, variable: Variable) -> Any:
        """Type of C that a variable has."""
        return C_TYPES[variable.size or variable.type]

    def accessor(self, action: str, variable: Variable) -> str:
        """Entry point that gets or sets values of this variable's type, as FMI 2.0 might call it."""
        return f"fmi2{action}{'Int64' if variable.type == 'Enumeration' else variable.size or variable.type}"

    def after(self, count: int) -> tuple[Any, ...]:
        """Arguments of an accessor after the values: their number, as there may be arrays."""
        return (ctypes.c_size_t(count),)

    def doer(self, duration: float) -> Callable[[float], int]:
        """Function of the start time that does a step and returns the status, or what its end means."""
        entry, pointer, time, keep = self.function(STEP), self.pointer, ctypes.c_double(), ctypes.c_bool(True)
        step, last = ctypes.c_double(duration), ctypes.c_double()
        event, ends, early = (ctypes.c_bool() for _ in range(3))
        answers = tuple(ctypes.byref(answer) for answer in (event, ends, early, last))

        def do(start: float) -> int:
            time.value, last.value = start, start + duration  # where an FMU does not tell it
            event.value = ends.value = early.value = False
            status = entry(pointer, time, step, keep, *answers)
            self.last = last.value
            end = reached(start, duration, last.value, ends=ends.value, early=early.value) if status <= WARNING else 0
            return end or status

        return do

    def judged(self, status: int, start: float, duration: float) -> int:
        """The status of a step, which says it all."""
        return status
