"""A host that gives NULL for each address in turn: `python null_host.py LIBRARY GUID RESOURCES FMI`.

Prints, as JSON, of each such call its status and messages.  A call whose name begins with `taken` is one in which NULL
is an answer like others, with `nobody` one without an instance.  Nothing but the standard library.
"""

from __future__ import annotations

import json
import sys
from ctypes import (
    CDLL,
    CFUNCTYPE,
    Structure,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_size_t,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
    create_string_buffer,
)  # fmt: skip
from typing import Any

LOGGER2 = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
LOGGER3 = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
TYPES2 = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
TYPES3 = {
    "Float32": c_float, "Float64": c_double, "Int8": c_int8, "UInt8": c_uint8, "Int16": c_int16, "UInt16": c_uint16,
    "Int32": c_int32, "UInt32": c_uint32, "Int64": c_int64, "UInt64": c_uint64, "Boolean": c_bool, "String": c_char_p,
}  # fmt: skip
ROOM = 8
LOG: list[str] = []


class Callbacks(Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [(name, c_void_p) for name in ("logger", "allocate", "free", "finished", "environment")]


def keep2(_: Any, instance: bytes, status: int, category: bytes, text: bytes) -> None:
    LOG.append(text.decode("utf-8", "replace"))


def keep3(_: Any, status: int, category: bytes, text: bytes) -> None:
    LOG.append(text.decode("utf-8", "replace"))


KEEP2, KEEP3 = LOGGER2(keep2), LOGGER3(keep3)


class Host:
    """One library, its instance, and the answers so far."""

    def __init__(self, path: str, guid: str, resources: str, fmi: int) -> None:
        self.library, self.prefix, self.fmi = CDLL(path), f"fmi{fmi}", fmi
        self.state = "FMUstate" if fmi == 2 else "FMUState"
        self.guid, self.resources = guid.encode(), resources.encode()
        self.answers: dict[str, tuple[int, list[str]]] = {}
        self.one = self.made(b"one", self.guid, self.resources)
        assert self.one, LOG

    def made(self, name: bytes | None, guid: bytes | None, resources: bytes | None, has_logger: bool = True) -> Any:
        if self.fmi == 2:
            make = self.library.fmi2Instantiate
            make.restype, make.argtypes = c_void_p, (c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int)
            self.callbacks = Callbacks()
            self.callbacks.logger = c_void_p.from_buffer(KEEP2)
            given = byref(self.callbacks) if has_logger else None
            return c_void_p(make(name, 1, guid, resources, given, 0, 1))
        make = self.library.fmi3InstantiateCoSimulation
        make.restype = c_void_p
        flags = (c_bool(False), c_bool(True), c_bool(False), c_bool(False))
        rest = (None, c_size_t(0), None, KEEP3 if has_logger else None, None)
        return c_void_p(make(name, guid, resources, *flags, *rest))

    def call(self, title: str, name: str, *arguments: Any) -> int:
        """Make a call that is to be judged, with an instance that can go on afterwards."""
        LOG.clear()
        status = int(getattr(self.library, self.prefix + name)(*arguments))
        self.answers[f"{title} {name}"] = (status, [*LOG])
        if arguments[0]:
            getattr(self.library, f"{self.prefix}Reset")(self.one)
        return status

    def everything(self) -> None:
        self.births()
        for kind, c_type in (TYPES2 if self.fmi == 2 else TYPES3).items():
            self.values(kind, c_type)
        self.states()
        self.others()

    def births(self) -> None:
        """No instance is made without identity; without a name or somebody to tell it may be."""
        for title, given in {
            "name": (None, self.guid, self.resources),
            "guid": (b"one", None, self.resources),
            "resources": (b"one", self.guid, None),
            "all": (None, None, None),
        }.items():
            for has_logger in (True, False):
                made = self.made(*given, has_logger)
                if made:
                    assert title in ("name", "resources"), title
                    getattr(self.library, f"{self.prefix}FreeInstance")(made)
        LOG.clear()

    def values(self, kind: str, c_type: Any) -> None:
        references, room = (c_uint32 * ROOM)(), (c_type * ROOM)()
        count = (c_size_t(1),) if self.fmi == 3 else ()
        for name in (f"Get{kind}", f"Set{kind}"):
            self.call("references", name, self.one, None, c_size_t(1), room, *count)
            self.call("values", name, self.one, references, c_size_t(1), None, *count)
            self.call("both", name, self.one, None, c_size_t(1), None, *count)
            self.call("nobody", name, None, references, c_size_t(1), room, *count)
        if kind == "String":
            text = next((k for k in range(200) if self.is_text(k)), None)
            if text is not None:
                references[0] = text
                self.call("a text", "SetString", self.one, references, c_size_t(1), (c_char_p * 1)(None), *count)

    def is_text(self, reference: int) -> bool:
        """Whether there is such a String."""
        references, room = (c_uint32 * 1)(reference), (c_char_p * 1)(b"x")
        count = (c_size_t(1),) if self.fmi == 3 else ()
        done = getattr(self.library, f"{self.prefix}SetString")(self.one, references, c_size_t(1), room, *count)
        getattr(self.library, f"{self.prefix}Reset")(self.one)
        return int(done) == 0

    def states(self) -> None:
        get, free = (getattr(self.library, f"{self.prefix}{verb}{self.state}") for verb in ("Get", "Free"))
        state, size, again = c_void_p(), c_size_t(), c_void_p()
        assert get(self.one, byref(state)) == 0
        size_of, written = f"Serialized{self.state}Size", f"Serialize{self.state}"
        read = f"{'DeSerialize' if self.fmi == 2 else 'Deserialize'}{self.state}"
        assert getattr(self.library, self.prefix + size_of)(self.one, state, byref(size)) == 0
        data = create_string_buffer(size.value)
        assert getattr(self.library, self.prefix + written)(self.one, state, data, size) == 0
        self.call("state", f"Get{self.state}", self.one, None)
        self.call("state", f"Set{self.state}", self.one, None)
        self.call("state", size_of, self.one, None, byref(size))
        self.call("size", size_of, self.one, state, None)
        self.call("state", written, self.one, None, data, size)
        self.call("bytes", written, self.one, state, None, size)
        self.call("bytes", read, self.one, None, size, byref(again))
        self.call("no bytes", read, self.one, None, c_size_t(0), byref(again))
        self.call("state", read, self.one, data, size, None)
        self.call("both", read, self.one, None, size, None)
        self.call("taken", f"Free{self.state}", self.one, None)
        for name, *given in (
            (f"Get{self.state}", byref(again)), (f"Set{self.state}", state), (size_of, state, byref(size)),
            (written, state, data, size), (read, data, size, byref(again)), (f"Free{self.state}", byref(again)),
        ):  # fmt: skip
            self.call("nobody", name, None, *given)
        assert not again.value
        assert free(self.one, byref(state)) == 0

    def others(self) -> None:
        names = (c_char_p * 2)(b"logAll", None)
        self.call("categories", "SetDebugLogging", self.one, 1, c_size_t(3), None)
        self.call("a category", "SetDebugLogging", self.one, 1, c_size_t(2), names)
        self.call("taken", "SetDebugLogging", self.one, 1, c_size_t(0), None)
        self.call("nobody", "SetDebugLogging", None, 1, c_size_t(0), None)
        for name in ("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"):
            start = (c_bool(False), c_double(0), c_double(0), c_bool(False), c_double(0))
            self.call("nobody", name, None, *(start if self.fmi == 3 and name.startswith("Enter") else ()))
        step = (c_double(0.0), c_double(1.0))
        if self.fmi == 2:
            self.call("nobody", "DoStep", None, *step, 0)
            self.call("nobody", "SetupExperiment", None, 0, c_double(0), c_double(0), 0, c_double(0))
            self.library.fmi2FreeInstance(None)
        else:
            self.call("nobody", "DoStep", None, *step, c_bool(False), None, None, None, None)
            self.library.fmi3FreeInstance(None)
        getattr(self.library, f"{self.prefix}FreeInstance")(self.one)


if __name__ == "__main__":
    host = Host(*sys.argv[1:4], int(sys.argv[4]))
    host.everything()
    print(json.dumps(host.answers))
