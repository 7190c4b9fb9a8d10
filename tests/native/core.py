"""The C of a native component called function by function, as a library in which all of them can be seen."""

from __future__ import annotations

import ctypes
import subprocess
from ctypes import POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_void_p
from pathlib import Path

from unpacked_native import STRICT

from gapsense.fmi.native import package

REPR = 32


class Text(Structure):
    """`Text` of text.h."""

    _fields_ = [("at", c_char_p), ("length", c_size_t), ("size", c_size_t)]


class State(Structure):
    """`State` of state.h."""

    _fields_ = [
        ("phase", c_int),
        ("is_timed", c_int),
        ("is_due", c_int),
        ("times", c_double * 4),
        ("block", c_void_p),
        ("values", POINTER(c_double)),
        ("par", POINTER(c_double)),
        ("kernel", POINTER(c_double)),
        ("memory", c_void_p),
        ("texts", c_void_p),
        ("tables", POINTER(POINTER(c_double))),
        ("sizes", POINTER(c_int)),
    ]


class Core:
    """The C of the component in a folder."""

    def __init__(self, component: Path, work: Path) -> None:
        self.folder, parts = component, package.gather(component, {})
        self.table_count = sum(len(port.columns) for port in parts.component.ports)
        for name, text in parts.files.items():
            (work / name).write_text(text, encoding="utf-8")
        sources = [path.name for path in sorted(work.glob("*.c"))]
        command = ["cc", *STRICT, "-O0", "-shared", "-fPIC", *sources, "-o", "core.so", "-lm"]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        self.library = ctypes.CDLL(str(work / "core.so"))
        self.library.number_in.restype = c_double
        self.library.state_new.restype = POINTER(State)
        self.library.state_read.restype = POINTER(State)
        self.library.state_size.restype = c_size_t
        self.library.repr.restype = c_char_p

    def repr(self, value: float) -> str:
        """A number as a message shows it."""
        return str(self.library.repr(c_double(value), ctypes.create_string_buffer(REPR)).decode())

    def printed(self, form: str, value: float) -> str:
        """A number in a format."""
        text = Text()
        self.library.text_add(byref(text), form.encode(), c_double(value))
        return str(text.at.decode())

    def number_in(self, text: bytes) -> float:
        """The number that a text holds."""
        return float(self.library.number_in(text))

    def tables(self, port: int, file: Path) -> list[list[float]] | str:
        """The tables that the kernel gets if a port names this file, or what is wrong with it."""
        state, problem = self.library.state_new(), Text()
        self.library.state_set_text(state, port, str(file).encode())
        self.library.read_tables(state, str(self.folder).encode(), byref(problem))
        made = state.contents
        found = [made.tables[k][: made.sizes[k]] for k in range(self.table_count)]
        self.library.state_free(state)
        return problem.at.decode() if problem.length else found

    def fresh_bytes(self) -> bytes:
        """The state of an instance that has just been made."""
        state = self.library.state_new()
        data = ctypes.create_string_buffer(self.library.state_size(state))
        self.library.state_write(state, data)
        self.library.state_free(state)
        return data.raw

    def read_bytes(self, data: bytes) -> str:
        """Read a state from bytes; what is wrong with them."""
        problem = Text()
        state = self.library.state_read(data, c_size_t(len(data)), byref(problem))
        self.library.state_free(state)
        assert bool(state) == (problem.length == 0)
        return problem.at.decode() if problem.length else ""
