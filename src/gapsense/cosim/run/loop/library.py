"""The C library that does base steps, for Linux on x86-64, and what it works on, as loop.c has it."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).resolve().with_name("loop.c")
BINARY = SOURCE.with_name("linux64") / "loop.so"
DONE, AT_SET, AT_STEP, AT_GET, NOT_FINITE, IN_PYTHON = range(6)  # what failed
PythonStep = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double)
PythonTake = ctypes.CFUNCTYPE(ctypes.c_int)
Number, Count, Double, Int = ctypes.c_int64, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
Numbers, Doubles = ctypes.POINTER(Number), ctypes.POINTER(Double)


class Link(ctypes.Structure):
    """One connection into a part."""

    _fields_ = [("target", Int), ("source", Int), ("converts", Int), ("factor", Double), ("bias", Double)]


class Watch(ctypes.Structure):
    """A condition of which news end a block."""

    _fields_ = [("place", Int), ("is_above", Int), ("is_on", Int), ("holds", Int), ("level", Double)]


class Exchange(ctypes.Structure):
    """One call that moves values."""

    _fields_ = [
        ("entry", ctypes.c_void_p),
        ("references", ctypes.POINTER(ctypes.c_uint)),
        ("count", Count),
        ("values", Doubles),
        ("value_count", Count),
    ]


class Part(ctypes.Structure):
    """One component; arrays given to a structure live as long as it does."""

    _fields_ = [
        ("fmi", Int),
        ("instance", ctypes.c_void_p),
        ("inputs", Exchange),
        ("outputs", Exchange),
        ("do_step", ctypes.c_void_p),
        ("duration", Double),
        ("links", ctypes.POINTER(Link)),
        ("link_count", Count),
        ("follows", Int),
        ("every", Number),
        ("steps_at", Number),
        ("takes_at", Number),
        ("calls", Number),
        ("warnings", Number),
        ("seconds", Double),
        ("counted", Double),
        ("longest", Double),
        ("spread", Numbers),
        ("python_step", PythonStep),
        ("python_take", PythonTake),
    ]


class Loop(ctypes.Structure):
    """A run."""

    _fields_ = [
        ("parts", ctypes.POINTER(Part)),
        ("part_count", Count),
        ("buffer", Doubles),
        ("start", Double),
        ("base_step", Double),
        ("is_jacobi", Int),
        ("decimation", Number),
        ("columns", Numbers),
        ("column_count", Count),
        ("data", Doubles),
        ("rows", Number),
        ("places", Numbers),
        ("place_count", Count),
        ("played", Doubles),
        ("played_from", Number),
        ("marks", Numbers),
        ("patience", Double),
        ("watches", ctypes.POINTER(Watch)),
        ("watch_count", Count),
        ("next", Number),
        ("clock", Double),
        ("part", Count),
        ("time", Double),
        ("status", Int),
        ("last", Double),
    ]


def entry() -> Callable[..., int] | None:
    """Function `loop` of the library, or None where it does not load: Python then does the same, more slowly."""
    return loaded(BINARY)


@cache
def loaded(binary: Path) -> Callable[..., int] | None:
    """Function `loop` of a library."""
    try:
        function: Any = ctypes.CDLL(str(binary)).loop
    except (OSError, AttributeError):  # another platform, no file, or not ours
        return None
    function.argtypes = [ctypes.POINTER(Loop), Number]
    found: Callable[..., int] = function
    return found


def address(function: Any) -> int | None:
    """Address of a function that ctypes has loaded."""
    return ctypes.cast(function, ctypes.c_void_p).value
