"""The functions of an FMU as a careless host calls them: `python raw.py FUNCTION library resources guid [arguments]` in
a process of its own, which prints what the function returns as JSON; arguments are one list in JSON.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
from collections.abc import Callable
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
LATIN = "Hüb %n".encode("latin-1")


class Callbacks(ctypes.Structure):
    _fields_ = [("logger", LOGGER)] + [(name, c_void_p) for name in ("allocate", "free", "finished", "environment")]


class Host:
    """A loaded library, and what it says."""

    def __init__(self, library: str, resources: str, guid: str) -> None:
        self.library, self.resources, self.guid = ctypes.CDLL(library), os.fsencode(resources), guid.encode()
        self.library.fmi2Instantiate.restype = c_void_p
        self.said: list[tuple[int, str, str]] = []
        self.callbacks = Callbacks(LOGGER(self._keep), None, None, None, None)

    def _keep(self, _: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        self.said.append((status, category.decode(), text.replace(b"%%", b"%").decode("utf-8", "surrogateescape")))

    def instantiate(self, **changes: Any) -> c_void_p | None:
        """A NULL instance is None."""
        given = {"name": b"one", "type": 1, "guid": self.guid, "resources": self.resources, "logging": 1} | changes
        strings = [given[k] for k in ("guid", "resources")]
        pointer = self.library.fmi2Instantiate(
            given["name"], given["type"], *strings, byref(self.callbacks), 0, given["logging"]
        )
        return c_void_p(pointer) if pointer else None

    def call(self, c: c_void_p | None, name: str, *arguments: Any) -> int:
        """Status of fmi2<name>."""
        return int(self.library[f"fmi2{name}"](c, *arguments))

    def started(self, **changes: Any) -> c_void_p:
        """An instance that is running from 0 s on."""
        c = self.instantiate(**changes)
        assert c is not None, self.said
        self.start(c)
        return c

    def start(self, c: c_void_p) -> None:
        zero = c_double(0.0)
        assert self.call(c, "SetupExperiment", 0, zero, zero, 0, zero) == 0
        assert self.call(c, "EnterInitializationMode") == self.call(c, "ExitInitializationMode") == 0

    def step(self, c: c_void_p, k: int, step: float) -> int:
        """The step of this number."""
        return self.call(c, "DoStep", c_double(k * step), c_double(step), 1)

    def refused_step(self, c: c_void_p, time: float) -> int:
        """A step back."""
        return self.call(c, "DoStep", c_double(time), c_double(-1.0), 1)

    def real(self, c: c_void_p, reference: int) -> float:
        value = c_double(-1.0)
        self.call(c, "GetReal", byref(c_uint(reference)), c_size_t(1), byref(value))
        return value.value

    def heard(self) -> list[tuple[int, str, str]]:
        """What was said since the last time."""
        said, self.said[:] = self.said[:], []
        return said


def instances(host: Host) -> dict[str, Any]:
    """What each way of instantiating says, and whether there is an instance; all without logging."""
    ways: dict[str, dict[str, Any]] = {
        "right": {},
        "wrong guid": {"guid": b"{00000000-0000-0000-0000-000000000000}"},
        "no guid": {"guid": None},
        "model exchange": {"type": 0},
        "no resources": {"resources": None},
        "name in latin-1": {"name": LATIN},
        "no name": {"name": None},
        "upper case": {"resources": host.resources.replace(b"file:", b"FILE:")},
        "host": {"resources": host.resources.replace(b"file://", b"file://localhost")},
        "slash": {"resources": host.resources + b"/"},
    }
    answers = {}
    for way, changes in ways.items():
        instance = host.instantiate(logging=0, **changes)
        answers[way] = {"is_made": instance is not None, "said": host.heard()}
    return answers


def name_in_latin_1(host: Host) -> dict[str, Any]:
    """A refusal names the instance by the bytes that the host gave."""
    c = host.started(name=LATIN)
    host.refused_step(c, 0.0)
    return {"said": host.heard(), "name": LATIN.decode("utf-8", "surrogateescape")}


def states(host: Host) -> dict[str, Any]:
    """Statuses of what can be done wrong with handles and buffers."""
    c, handle, size = host.started(), c_void_p(), c_size_t()
    facts: dict[str, Any] = {"free NULL": host.call(c, "FreeFMUstate", None)}
    facts["free nothing"] = host.call(c, "FreeFMUstate", byref(handle))
    host.call(c, "GetFMUstate", byref(handle))
    before = handle.value
    facts["again"] = host.call(c, "GetFMUstate", byref(handle)), handle.value == before
    facts["size"] = host.call(c, "SerializedFMUstateSize", handle, byref(size)), size.value
    long = ctypes.create_string_buffer(b"\x7f" * (size.value + 8), size.value + 8)
    facts["long"] = host.call(c, "SerializeFMUstate", handle, long, c_size_t(size.value + 8)), long.raw[-8:].hex()
    facts["said"] = host.heard()
    small = ctypes.create_string_buffer(b"\x7f" * 8, 8)
    facts["small"] = host.call(c, "SerializeFMUstate", handle, small, c_size_t(4)), small.raw.hex(), host.heard()
    other = c_void_p()
    facts["longer bytes"] = restored(host, host.started(), long.raw, byref(other)), host.heard()
    facts["set nothing"] = host.call(host.started(), "SetFMUstate", None), host.heard()
    facts["free"] = host.call(c, "FreeFMUstate", byref(handle)), handle.value
    return facts


def restored(host: Host, c: c_void_p, data: bytes, handle: Any) -> int:
    status = host.call(c, "DeSerializeFMUstate", data, c_size_t(len(data)), handle)
    return status or host.call(c, "SetFMUstate", handle._obj)


def handles(host: Host) -> dict[str, Any]:
    """Growth of the memory [bytes] when states are saved into one handle again and again."""
    c, handle = host.started(), c_void_p()
    growth = []
    for _ in range(3):
        before = resident()
        for _ in range(5000):
            host.call(c, "GetFMUstate", byref(handle))
        gc.collect()
        growth.append(resident() - before)
    return {"growth": growth}


def failures(host: Host) -> dict[str, Any]:
    """Growth of the memory [bytes] when instances fail, are reset or not, and are freed."""
    growth = []
    for _ in range(3):
        before = resident()
        for k in range(500):
            c = host.started()
            host.refused_step(c, 0.0)
            if k % 2:
                host.call(c, "Reset")
            host.library.fmi2FreeInstance(c)
            host.heard()
        gc.collect()
        growth.append(resident() - before)
    return {"growth": growth}


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def refusal(host: Host) -> dict[str, Any]:
    """An instance that refused a step: what it said, and its outputs after a reset beside those of a fresh one."""
    c, step = host.started(), 1e-3
    facts: dict[str, Any] = {"before": [host.step(c, k, step) for k in range(5)]}
    facts["refused"] = host.refused_step(c, 5 * step), host.heard()
    facts["reset"] = host.call(c, "Reset"), host.heard()
    both = [c, host.started()]
    host.start(c)
    facts["traces"] = [[(host.step(i, k, step), host.real(i, 4)) for k in range(20)] for i in both]
    facts["freed"] = [host.library.fmi2FreeInstance(i) is not None for i in both]
    return facts


def missing(host: Host) -> dict[str, Any]:
    """What is not provided: status and what is said; and a step afterwards."""
    c, one, value = host.started(), c_size_t(1), byref(c_double(0.0))
    vr, order = byref(c_uint(0)), byref(c_int(1))
    calls: dict[str, Callable[[], int]] = {
        "CancelStep": lambda: host.call(c, "CancelStep"),
        "GetDirectionalDerivative": lambda: host.call(c, "GetDirectionalDerivative", vr, one, vr, one, value, value),
        "SetRealInputDerivatives": lambda: host.call(c, "SetRealInputDerivatives", vr, one, order, value),
        "GetRealOutputDerivatives": lambda: host.call(c, "GetRealOutputDerivatives", vr, one, order, value),
        **{f"Get{kind}Status": lambda kind=kind: host.call(c, f"Get{kind}Status", 2, value) for kind in KINDS},
    }
    answers = {name: (call(), host.heard()) for name, call in calls.items()}
    return {"answers": answers, "step": host.step(c, 0, 1e-3)}


KINDS = ("", "Real", "Integer", "Boolean", "String")


def texts(host: Host, cases: list[list[str]]) -> list[Any]:
    """What initialisation answers to each case: value references and texts, one after the other."""
    answers = []
    for case in cases:
        c, zero = host.instantiate(), c_double(0.0)
        for reference, text in zip(case[::2], case[1::2]):
            value = c_char_p(os.fsencode(text))
            assert host.call(c, "SetString", byref(c_uint(int(reference))), c_size_t(1), byref(value)) == 0
        host.call(c, "SetupExperiment", 0, zero, zero, 0, zero)
        host.call(c, "EnterInitializationMode")
        answers.append((host.call(c, "ExitInitializationMode"), host.heard()))
    return answers


def references(host: Host) -> dict[str, Any]:
    """Reading and setting variables near 2^32 and beside the table."""
    facts = {}
    for reference in (2**32 - 1, 2**32 - 4, 2**31, 2**31 - 1, 1000):
        for name in ("GetReal", "SetReal", "GetInteger", "SetBoolean"):
            c = host.started()
            host.heard()
            status = host.call(c, name, byref(c_uint(reference)), c_size_t(1), byref(c_double(0.0)))
            facts[f"{name} {reference}"] = status, len(host.heard())
    return facts


def odd_values(host: Host) -> dict[str, Any]:
    """What a slave that answers oddly makes of a call, for each of its oddities; and texts that are not UTF-8."""
    facts: dict[str, Any] = {}
    for k in range(8):
        c = host.started()
        host.step(c, k, 1.0)
        host.heard()
        value = c_double(-1.0)
        status = host.call(c, "GetReal", byref(c_uint(0)), c_size_t(1), byref(value))
        facts[str(k)] = status, value.value, host.heard()
    c, text = host.started(), c_char_p(LATIN)
    host.call(c, "SetString", byref(c_uint(1)), c_size_t(1), byref(text))
    back = c_char_p()
    facts["text"] = host.call(c, "GetString", byref(c_uint(1)), c_size_t(1), byref(back)), back.value == LATIN
    return facts


def categories(host: Host) -> dict[str, Any]:
    """Categories heard in a step, by what was asked for."""
    asked: dict[str, tuple[int, list[bytes]]] = {
        "all": (1, []),
        "warnings": (1, [b"logStatusWarning"]),
        "all by name": (1, [b"logAll"]),
        "errors": (1, [b"logStatusError"]),
        "off": (0, []),
    }
    c, facts = host.started(), {}
    for k, (name, (on, wanted)) in enumerate(asked.items()):
        host.call(c, "SetDebugLogging", on, c_size_t(len(wanted)), (c_char_p * len(wanted))(*wanted))
        host.step(c, k, 0.01)
        facts[name] = [category for _, category, _ in host.heard()]
    return facts


def many(host: Host) -> dict[str, Any]:
    """A thousand instances at once."""
    all_of_them = [host.started(name=b"number %d" % k) for k in range(1000)]
    stati = {host.step(c, k, 1e-3) for k in range(3) for c in all_of_them}
    values = {host.real(c, 4) for c in all_of_them}
    for c in all_of_them:
        host.library.fmi2FreeInstance(c)
    return {"stati": list(stati), "values": list(values)}


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](Host(*sys.argv[2:5]), *map(json.loads, sys.argv[5:]))))
