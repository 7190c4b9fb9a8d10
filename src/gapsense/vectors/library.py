"""What loop.c works on, as it has it, and the C libraries: one for the loop, one for each kernel."""

from __future__ import annotations

import ctypes
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from gapsense.fmi.components import kernel_of, load_component, own
from gapsense.fmi.ports import Component
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Code, OverRuns, over_runs
from gapsense.kernels.lanes.library import HERE, loaded
from gapsense.kernels.lanes.plan import Column

SOURCE = Path(__file__).resolve().with_name("loop.c")
Int, Size, Long, Pointer = ctypes.c_int, ctypes.c_ssize_t, ctypes.c_int64, ctypes.c_void_p
NUMBERS = {"int": Int, "ptrdiff_t": Size, "int64_t": Long, "double": ctypes.c_double}
TYPEDEF = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
COMMENT, FIELDS = re.compile(r"/\*.*?\*/", re.DOTALL), re.compile(r"(?:const )?(\w+) ([\w*, ]+);")


def structures(source: str) -> dict[str, Any]:
    """The structures that a source of C declares, by name; one in another shares its fields with that."""
    made: dict[str, Any] = {**NUMBERS, "Column": Column}
    for body, name in TYPEDEF.findall(COMMENT.sub("", source)):
        fields = [
            (field.lstrip("*"), pointer(made.get(kind)) if field[0] == "*" else made[kind])
            for kind, names in FIELDS.findall(body)
            for field in names.split(", ")
        ]
        inner = [field for field, kind in fields if field == "block"]
        made.setdefault(name, type(name, (ctypes.Structure,), {"_anonymous_": inner, "_fields_": fields}))
    return made


def pointer(kind: Any) -> Any:
    """Pointer to a structure or to whole numbers; to anything else a plain address."""
    return ctypes.POINTER(kind) if kind is Int or (kind and issubclass(kind, ctypes.Structure)) else Pointer


MADE = structures((HERE / "lanes.h").read_text("utf-8") + SOURCE.read_text("utf-8"))
Call, Link, Stage, Range, Watch, Part = (MADE[name] for name in ("Call", "Link", "Stage", "Range", "Watch", "Part"))
Loop, Runs, Signal = MADE["Loop"], MADE["Runs"], MADE["Signal"]


def filled(structure: Any, **fields: Any) -> Any:
    """A structure of C, which keeps its arrays; a list becomes one, and its length is put into the field behind it."""
    given, kinds = {**fields}, structure._fields_
    for (name, kind), (count, _) in zip(kinds, kinds[1:]):
        if isinstance(fields.get(name), list):
            given |= {name: (kind._type_ * len(fields[name]))(*fields[name]), count: len(fields[name])}
    return structure(**given)


class Functions(NamedTuple):
    """The port table of a component, and the functions of its kernel with their addresses in C."""

    component: Component
    folder: Path
    kernel: Kernel
    codes: OverRuns
    addresses: tuple[int, ...]  # of the functions in `codes`


@cache
def functions(name: str) -> Functions | None:
    """Those of one of our components, compiled; None where no compiler is."""
    folder = own(name)
    component = load_component(folder)
    kernel = kernel_of(component)
    codes = over_runs(kernel)
    parts = [(HERE / "lanes.h").read_text("utf-8"), *(exported(n, c) for n, c in codes._asdict().items())]
    library = loaded("\n".join(parts))
    if library is None:
        return None
    addresses = (ctypes.cast(getattr(library, name), Pointer).value or 0 for name in codes._fields)
    return Functions(component=component, folder=folder, kernel=kernel, codes=codes, addresses=tuple(addresses))


def exported(name: str, code: Code) -> str:
    """C of a function, under a name by which the library gives it away."""
    return code.c.text.replace("static void NAME(", f"void {name}(", 1)


@cache
def loop() -> Any:
    """The library that does base steps; None where no compiler is."""
    library = loaded("\n".join([(HERE / "lanes.h").read_text("utf-8"), SOURCE.read_text("utf-8")]))
    if library is not None:
        part, loop, runs, signals = (ctypes.POINTER(kind) for kind in (Part, Loop, Runs, Signal))
        library.prepare.argtypes = [part, runs]
        library.begin.argtypes = [loop, runs, part, Int]
        library.play_first.argtypes = [loop, runs]
        library.advance.argtypes = [loop, runs, Long]
        library.filter.argtypes = [loop, runs, part, signals, Size, ctypes.POINTER(Int), Size, Long]
    return library


def ints(values: Any) -> Any:
    """Whole numbers, for C."""
    found = [*values]
    return (Int * len(found))(*found)
