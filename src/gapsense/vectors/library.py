"""What loop.c works on, as it has it, and the C libraries: one for the loop, one for each kernel."""

from __future__ import annotations

import ctypes
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
Int, Long, Size, Double, Pointer = ctypes.c_int, ctypes.c_int64, ctypes.c_ssize_t, ctypes.c_double, ctypes.c_void_p
Wholes, Doubles = ctypes.POINTER(Int), ctypes.POINTER(Double)


def structure(name: str, **fields: Any) -> Any:
    """A structure of C; arrays given to one live as long as it does."""
    return type(name, (ctypes.Structure,), {"_fields_": [*fields.items()]})


Call: Any = structure("Call", function=Pointer, at=Wholes, k=Doubles)
Link: Any = structure("Link", target=Int, source=Int, converts=Int, factor=Double, bias=Double)
Stage: Any = structure(
    "Stage", **dict.fromkeys(("before", "held", "after", "holds", "converts", "factor", "bias"), Int)
)
Range: Any = structure("Range", place=Int, low=Double, high=Double)
Watch: Any = structure("Watch", **dict.fromkeys(("place", "is_above", "is_on", "holds", "level"), Int))
Part: Any = structure(
    "Part",
    **dict.fromkeys(("constants", "initial", "advance"), Call),
    links=ctypes.POINTER(Link),
    link_count=Size,
    stages=ctypes.POINTER(Stage),
    stage_count=Size,
    ranges=ctypes.POINTER(Range),
    range_count=Size,
    **dict.fromkeys(("survives", "follows", "buffered", "own", "input_count", "output", "output_count"), Int),
    **dict.fromkeys(("time", "dt"), Int),
    duration=Double,
    period=Double,
    samples=Wholes,
    every=Long,
    offset=Long,
)
Loop: Any = structure(
    "Loop",
    parts=ctypes.POINTER(Part),
    part_count=Size,
    start=Double,
    base_step=Double,
    is_jacobi=Int,
    decimation=Long,
    rows=Long,
    columns=Wholes,
    column_count=Size,
    places=Wholes,
    place_count=Size,
    watches=ctypes.POINTER(Watch),
    watch_count=Size,
    failed=Int,
)
Runs: Any = structure(
    "Runs",
    columns=ctypes.POINTER(Column),
    first=Size,
    count=Int,
    v=Pointer,
    data=Pointer,
    played=Pointer,
    played_from=Long,
    next=Long,
)

Signal: Any = structure("Signal", address=Pointer, run=Size, sample=Size)


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
        library.prepare.argtypes = [ctypes.POINTER(Part), ctypes.POINTER(Runs)]
        library.begin.argtypes = [ctypes.POINTER(Loop), ctypes.POINTER(Runs), ctypes.POINTER(Part), Int]
        library.play_first.argtypes = [ctypes.POINTER(Loop), ctypes.POINTER(Runs)]
        library.advance.argtypes = [ctypes.POINTER(Loop), ctypes.POINTER(Runs), Long]
        of_one = [ctypes.POINTER(Loop), ctypes.POINTER(Runs), ctypes.POINTER(Part), ctypes.POINTER(Signal)]
        library.filter.argtypes = [*of_one, Size, Wholes, Size, Long]
    return library


def ints(values: Any) -> Any:
    """Whole numbers, for C."""
    found = [*values]
    return (Int * len(found))(*found)
