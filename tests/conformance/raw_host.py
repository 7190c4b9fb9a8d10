"""A host that makes FMI 2.0 calls as they are, good or bad: `python raw_host.py LIBRARY`.

A list of calls comes on each line of standard input, a list of answers goes out: status, value, messages.  It has a
process of its own, because what is tried here may end it.  Nothing but the standard library, and nothing of Gapsense.
"""

from __future__ import annotations

import json
import sys
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Array,
    Structure,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint32,
    c_void_p,
    cast,
    create_string_buffer,
)
from typing import Any

TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
PLAIN: dict[str, tuple[Any, ...]] = {
    "SetupExperiment": (c_int, c_double, c_double, c_int, c_double),
    "EnterInitializationMode": (),
    "ExitInitializationMode": (),
    "DoStep": (c_double, c_double, c_int),
    "Terminate": (),
    "Reset": (),
    "CancelStep": (),
}
LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_void_p)
ALLOCATE = CFUNCTYPE(c_void_p, c_size_t, c_size_t)
FREE = CFUNCTYPE(None, c_void_p)
LOG: list[tuple[str, int, str, str]] = []


class Callbacks(Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [
        ("logger", LOGGER), ("allocate", ALLOCATE), ("free", FREE), ("finished", c_void_p), ("environment", c_void_p)
    ]  # fmt: skip


def keep(_: Any, instance: bytes, status: int, category: bytes, text: bytes, first: int) -> None:
    """Keep a message; its text is a format of printf, as a rule without arguments or `%s` with one."""
    said = cast(first, c_char_p).value if text == b"%s" else text.replace(b"%%", b"%")
    LOG.append(tuple([decoded(instance), status, decoded(category), decoded(said)]))  # type: ignore[arg-type]


def decoded(text: bytes | None) -> str:
    return (text or b"").decode("utf-8", "surrogateescape")


def encoded(text: str | None) -> bytes | None:
    return None if text is None else text.encode("utf-8", "surrogateescape")


C = CDLL(None)
C.calloc.restype, C.calloc.argtypes, C.free.argtypes = c_void_p, (c_size_t, c_size_t), (c_void_p,)
CALLBACKS = Callbacks(LOGGER(keep), ALLOCATE(C.calloc), FREE(C.free), None, None)


class Host:
    """The library, its instances and their saved states, each by a number of ours."""

    def __init__(self, path: str) -> None:
        self.library = CDLL(path)
        self.instances: list[c_void_p] = []
        self.states: dict[int, c_void_p] = {}

    def answer(self, call: list[Any]) -> tuple[Any, Any, list[Any]]:
        """Make one call: its name, the instance's number, arguments."""
        LOG.clear()
        name, instance, *arguments = call
        status, value = getattr(self, name, self.other)(call if name not in dir(self) else instance, *arguments)
        return status, value, list(LOG)

    def function(self, name: str, *types: Any) -> Any:
        found = getattr(self.library, f"fmi2{name}")
        found.argtypes = (c_void_p, *types)
        return found

    def other(self, call: list[Any], *arguments: Any) -> tuple[int, Any]:
        name, c = call[0], self.instances[call[1]]
        if name in PLAIN:
            return self.function(name, *PLAIN[name])(c, *arguments), None
        if name[:3] == "Get":
            return self.get(c, TYPES[name[3:]], name, *arguments)
        return self.set(c, TYPES[name[3:]], name, *arguments)

    def get(self, c: c_void_p, kind: Any, name: str, refs: list[int]) -> tuple[int, Any]:
        values = (kind * len(refs))()
        status = self.function(name, POINTER(c_uint32), c_size_t, POINTER(kind))(c, numbers(refs), len(refs), values)
        return status, [decoded(v) if isinstance(v, bytes) else v for v in values]

    def set(self, c: c_void_p, kind: Any, name: str, refs: list[int], values: list[Any]) -> tuple[int, Any]:
        given = (kind * len(refs))(*(encoded(v) if isinstance(v, str) else v for v in values))
        return self.function(name, POINTER(c_uint32), c_size_t, POINTER(kind))(c, numbers(refs), len(refs), given), None

    # --- instances ---

    def instantiate(
        self, _: int, name: str | None, kind: int, guid: str | None, resources: str | None, log: int
    ) -> Any:
        make = self.library.fmi2Instantiate
        make.restype, make.argtypes = c_void_p, (c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int)
        made = make(encoded(name), kind, encoded(guid), encoded(resources), byref(CALLBACKS), 0, log)
        if made:
            self.instances.append(c_void_p(made))
        return 0, len(self.instances) - 1 if made else None

    def free(self, instance: int) -> tuple[int, Any]:
        self.function("FreeInstance")(self.instances[instance])
        return 0, None

    def SetDebugLogging(self, instance: int, on: int, names: list[str]) -> tuple[int, Any]:
        texts = (c_char_p * len(names))(*map(encoded, names))
        function = self.function("SetDebugLogging", c_int, c_size_t, POINTER(c_char_p))
        return function(self.instances[instance], on, len(names), texts), None

    # --- saved states ---

    def GetFMUstate(self, instance: int, slot: int) -> tuple[int, Any]:
        """The value is whether a handle that was there stayed the same."""
        handle = self.states.setdefault(slot, c_void_p())
        before = handle.value
        status = self.function("GetFMUstate", c_void_p)(self.instances[instance], byref(handle))
        return status, before is None or before == handle.value

    def SetFMUstate(self, instance: int, slot: int | None) -> tuple[int, Any]:
        handle = c_void_p() if slot is None else self.states.setdefault(slot, c_void_p())
        return self.function("SetFMUstate", c_void_p)(self.instances[instance], handle), None

    def FreeFMUstate(self, instance: int, slot: int | None) -> tuple[int, Any]:
        """The value is what is left of the handle."""
        handle = None if slot is None else self.states.setdefault(slot, c_void_p())
        where = None if handle is None else byref(handle)
        return self.function("FreeFMUstate", c_void_p)(
            self.instances[instance], where
        ), None if handle is None else handle.value

    def SerializeFMUstate(self, instance: int, slot: int, size: int | None = None) -> tuple[int, Any]:
        """Bytes, in a buffer of the size that is asked for, or another."""
        c, handle, needed = self.instances[instance], self.states.setdefault(slot, c_void_p()), c_size_t()
        status = self.function("SerializedFMUstateSize", c_void_p, c_void_p)(c, handle, byref(needed))
        if status:
            return status, None
        room = needed.value if size is None else size
        buffer = create_string_buffer(b"#" * (max(room, needed.value) + 64))
        status = self.function("SerializeFMUstate", c_void_p, c_char_p, c_size_t)(c, handle, buffer, room)
        return status, buffer.raw[: room if size is None else None].hex()

    def DeSerializeFMUstate(self, instance: int, data: str, slot: int) -> tuple[int, Any]:
        given, handle = bytes.fromhex(data), self.states.setdefault(slot, c_void_p())
        function = self.function("DeSerializeFMUstate", c_char_p, c_size_t, c_void_p)
        return function(self.instances[instance], given, len(given), byref(handle)), None

    # --- what is not provided ---

    def SetRealInputDerivatives(self, instance: int) -> tuple[int, Any]:
        return self._about(instance, "SetRealInputDerivatives", one(c_uint32), 1, one(c_int, 1), one(c_double)), None

    def GetRealOutputDerivatives(self, instance: int) -> tuple[int, Any]:
        return self._about(instance, "GetRealOutputDerivatives", one(c_uint32), 1, one(c_int, 1), one(c_double)), None

    def GetDirectionalDerivative(self, instance: int) -> tuple[int, Any]:
        refs, values = one(c_uint32), one(c_double)
        return self._about(instance, "GetDirectionalDerivative", refs, 1, refs, 1, values, values), None

    def status_of(self, instance: int, kind: str) -> tuple[int, Any]:
        """fmi2GetStatus, fmi2GetRealStatus, ..."""
        value = {"": c_int, **TYPES}[kind]()
        return self._about(instance, f"Get{kind}Status", 0, byref(value)), None

    def _about(self, instance: int, name: str, *arguments: Any) -> int:
        function = getattr(self.library, f"fmi2{name}")
        function.argtypes = None
        sized = [c_size_t(a) if isinstance(a, int) and a else a for a in arguments]
        return int(function(self.instances[instance], *sized))


def numbers(refs: list[int]) -> Any:
    return (c_uint32 * len(refs))(*refs)


def one(kind: Any, value: Any = 0) -> Array[Any]:
    found: Array[Any] = (kind * 1)(value)
    return found


if __name__ == "__main__":
    out, sys.stdout = sys.stdout, sys.stderr
    host = Host(sys.argv[1])
    for line in sys.stdin:
        print(json.dumps([host.answer(call) for call in json.loads(line)]), file=out, flush=True)
