"""The library of an FMU in this process: where it is for this platform, and an instance that it makes.

What fmpy does for this takes longer than many a run: it loads much, and looks at all functions of each instance.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
from collections.abc import Callable
from ctypes import c_bool, c_char_p, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any, NamedTuple

SHORT, SYSTEM, ENDING = {
    "win32": ("win", "windows", ".dll"),
    "darwin": ("darwin", "darwin", ".dylib"),
}.get(sys.platform, ("linux", "linux", ".so"))
BITS = 64 if sys.maxsize > 2**32 else 32
ARM = "aarch64" if platform.machine().lower() in ("aarch64", "arm64") else ""
FOLDERS = {2: f"{SHORT}{BITS}", 3: f"{ARM or ('x86_64' if BITS == 64 else 'x86')}-{SYSTEM}"}  # by the version of FMI
CO_SIMULATION = 1
Log = Callable[..., None]
Logger2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Logger3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    """What an FMU of FMI 2.0 may call."""

    _fields_ = [
        ("logger", Logger2),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


class Loaded(NamedTuple):
    """An instance in its library, and what that may call, kept as long as it."""

    library: ctypes.CDLL
    component: int
    kept: object

    def free(self, function: str) -> None:
        """Free the instance by a function of the library, then the library."""
        free, handle = self.library[function], c_void_p(self.library._handle)
        free.restype = None
        free(c_void_p(self.component))
        if sys.platform == "win32":
            ctypes.windll.kernel32.FreeLibrary(handle)
        else:
            ctypes.CDLL(None).dlclose(handle)


def path_in(fmi: int, identifier: str) -> str:
    """Path of a library in an FMU."""
    return f"binaries/{FOLDERS[fmi]}/{identifier}{ENDING}"


def load(folder: Path, fmi: int, identifier: str) -> ctypes.CDLL:
    """The library of an unpacked FMU; its folder, where some look for what they need, is the working folder then."""
    file = folder / path_in(fmi, identifier)
    os.chdir(file.parent)
    return ctypes.CDLL(str(file))


def made(library: ctypes.CDLL, function: str, kept: object, *arguments: Any) -> Loaded:
    """An instance, from the function that makes it; `kept` are its callbacks."""
    make = library[function]
    make.restype = c_void_p
    component = make(*arguments)
    if not component:
        raise OSError(f"{function} returned no instance")
    return Loaded(library, component, kept)


def instance_2(library: ctypes.CDLL, name: str, guid: str, folder: Path, log: Log) -> Loaded:
    """An instance of FMI 2.0."""
    standard = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    allocate, free = (ctypes.cast(function, c_void_p) for function in (standard.calloc, standard.free))
    callbacks = Callbacks(logger=Logger2(log), allocate=allocate, free=free)
    texts = name.encode(), c_int(CO_SIMULATION), guid.encode(), (folder / "resources").as_uri().encode()
    return made(library, "fmi2Instantiate", callbacks, *texts, ctypes.byref(callbacks), c_int(0), c_int(1))


def instance_3(library: ctypes.CDLL, name: str, guid: str, folder: Path, log: Log) -> Loaded:
    """An instance of FMI 3.0, without event mode, early return and intermediate values."""
    logger, no, none = Logger3(log), c_bool(False), c_void_p()
    texts = name.encode(), guid.encode(), os.path.join(folder, "resources", "").encode()  # noqa: PTH118  # ends in `/`
    options = (no, c_bool(True), no, no, none, c_size_t(0), none)
    return made(library, "fmi3InstantiateCoSimulation", logger, *texts, *options, logger, none)
