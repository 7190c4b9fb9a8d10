"""A component-step as one call into a small C library, on the platform that has one: Linux on x86-64."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).resolve().with_name("turn.c")
BINARY = SOURCE.with_name("linux64") / "turn.so"


class Link(ctypes.Structure):
    """One connection into a component, as turn.c has it."""

    _fields_ = [
        *((name, ctypes.c_int) for name in ("target", "source", "converts")),
        *((name, ctypes.c_double) for name in ("factor", "bias")),
    ]


class Turn(ctypes.Structure):
    """One component, as turn.c has it; arrays given to it live as long as it does."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("instance", "set", "get", "step")),
        *((name, ctypes.POINTER(ctypes.c_uint)) for name in ("inputs", "outputs")),
        *((name, ctypes.POINTER(ctypes.c_double)) for name in ("input_values", "output_values")),
        *((name, ctypes.c_size_t) for name in ("input_count", "output_count")),
        ("buffer", ctypes.POINTER(ctypes.c_double)),
        ("links", ctypes.POINTER(Link)),
        ("link_count", ctypes.c_size_t),
        ("duration", ctypes.c_double),
        ("status", ctypes.c_int),
    ]


def entry() -> Callable[..., int] | None:
    """Function `turn` of the library, or None where it does not load: Python then does the same, more slowly."""
    try:
        function: Callable[..., int] = ctypes.CDLL(str(BINARY)).turn
    except OSError:  # another platform, or no file
        return None
    return function


def address(function: Any) -> int | None:
    """Address of a function that ctypes has loaded."""
    return ctypes.cast(function, ctypes.c_void_p).value
