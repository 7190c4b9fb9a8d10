"""What asks the slave, and what becomes of steps that fail: `python lending.py FUNCTION library resources guid` in a
process of its own, which prints what the function returns as JSON; arguments are one list in JSON.
"""

from __future__ import annotations

import ctypes
import json
import math
import sys
from collections import Counter
from collections.abc import Callable
from ctypes import byref, c_double, c_size_t, c_uint, c_void_p
from typing import Any

from raw import Host
from twins import class_in

STEP = 50e-6
METHODS = ("get_real", "set_real", "do_step", "lend", "get_boolean", "_get_fmu_state", "_set_fmu_state")


def asked(host: Host) -> dict[str, Any]:
    """How often the slave's methods are called in hundred usual rounds, and in rounds with one more call each."""
    cls, calls = class_in(host), Counter[str]()
    for name in METHODS:
        setattr(cls, name, counted(getattr(cls, name), name, calls))
    c, handle = host.started(), c_void_p()
    others: dict[str, Callable[[], int]] = {
        "nothing": lambda: 0,
        "no variable": lambda: exchange(host, c, "GetReal", [], 0),
        "parameter": lambda: exchange(host, c, "GetReal", [14], 1),
        "saved": lambda: host.call(c, "GetFMUstate", byref(handle)),
        "restored": lambda: host.call(c, "SetFMUstate", handle),
    }
    host.step(c, 0, STEP)
    found: dict[str, Any] = {}
    for k, (name, other) in enumerate(others.items()):
        calls.clear()
        stati = {status for j in range(100) for status in (*round_(host, c, 1 + 100 * k + j * (k < 4)), other())}
        found[name] = {"stati": [*stati], "calls": dict(calls)}
    return found


def counted(method: Any, name: str, calls: Counter[str]) -> Any:
    def counting(*arguments: Any) -> Any:
        calls[name] += 1
        return method(*arguments)

    return counting


def round_(host: Host, c: c_void_p, k: int) -> list[int]:
    """Set, step and get, of `Semera`."""
    stati = [exchange(host, c, "SetReal", [0, 1], 2), host.step(c, k, STEP)]
    return [*stati, exchange(host, c, "GetReal", [*range(2, 14)], 12)]


def exchange(host: Host, c: c_void_p, name: str, refs: list[int], count: int) -> int:
    return host.call(c, name, (c_uint * count)(*refs), c_size_t(count), (c_double * count)())


def failing(host: Host, kind: str) -> dict[str, Any]:
    """A step of the kernel that goes wrong: status, messages, whether the outputs stay; then set, step, get, reset."""
    cls, mood = class_in(host), [""]
    advance = cls.kernel.advance

    def moody(state: Any, inputs: Any, constants: Any) -> Any:
        if mood[0] == "raises":
            raise ArithmeticError("in the kernel")
        if mood[0] == "interrupted":
            raise KeyboardInterrupt
        state, outputs = advance(state, inputs, constants)
        odd = {"infinite": (math.inf, *outputs[1:]), "no numbers": ("x", *outputs[1:])}
        return state, odd.get(mood[0], outputs)

    cls.kernel.advance, c = moody, host.started()
    for k in range(3):
        host.step(c, k, STEP)
    before, mood[0] = outputs_of(host, c), kind
    status, said = host.step(c, 3, STEP), host.heard()
    found = {"status": status, "said": said, "is_kept": outputs_of(host, c) == before}
    mood[0] = ""
    found["afterwards"] = round_(host, c, 4), host.call(c, "Reset")
    return found


def outputs_of(host: Host, c: c_void_p) -> list[float]:
    return [host.real(c, reference) for reference in range(2, 14)]


def without_python(host: Host, library: str) -> None:
    """Have C call the instance after Python has ended; it prints status and value."""
    c = host.started()
    host.step(c, 0, STEP)
    ctypes.CDLL(library).after_python(c, *(host.library[f"fmi2{name}"] for name in ENDED))
    globals()["kept"] = host  # its library stays to the end


ENDED = ("SetReal", "GetReal", "DoStep", "GetFMUstate", "FreeInstance")

if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](Host(*sys.argv[2:5]), *map(json.loads, sys.argv[5:]))), flush=True)
