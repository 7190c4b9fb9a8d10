"""The records that loop.c works on, the places of the numbers of components in them, and the C libraries.

There is one library for the loop, and one for each kernel.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.native import structures
from gapsense.fmi.components import kernel_of, load_component, own
from gapsense.fmi.ports import Component
from gapsense.kernels.emit.c import held
from gapsense.kernels.emit.lanes import is_array
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Code, OverRuns, over_runs
from gapsense.kernels.lanes.library import addresses, load_library, with_types
from gapsense.kernels.lanes.plan import Column, columns_in_c
from gapsense.kernels.layout import fields, names

SOURCE = Path(__file__).resolve().with_name("loop.c")
Int, Size, Long, Pointer = ctypes.c_int, ctypes.c_ssize_t, ctypes.c_int64, ctypes.c_void_p
CLOCK = ("time", "dt")  # inputs of a kernel that the loop gives
MADE = structures(with_types(SOURCE.read_text("utf-8")), Column=Column)
Call, Link, Stage, Range, Watch, Part = (MADE[name] for name in ("Call", "Link", "Stage", "Range", "Watch", "Part"))
Loop, Runs, Signal = MADE["Loop"], MADE["Runs"], MADE["Signal"]


def fill_structure(structure: Any, **fields: Any) -> Any:
    """Fill a C structure, which keeps its arrays; a list becomes one, and its length goes into the field behind it."""
    given, kinds = {**fields}, structure._fields_
    for (name, kind), (count, _) in zip(kinds, kinds[1:]):
        if isinstance(fields.get(name), list):
            given |= {name: (kind._type_ * len(fields[name]))(*fields[name]), count: len(fields[name])}
    return structure(**given)


class Functions(NamedTuple):
    """The functions of a kernel with their addresses in C, and the port table of its component, if it has one."""

    kernel: Kernel
    codes: OverRuns
    addresses: tuple[int, ...]  # of the functions in `codes`
    component: Component = Component("", "", "", (), survives=True)
    folder: Path = Path()

    @property
    def inputs(self) -> list[str]:
        """Flat inputs that can be connected, in order."""
        return [name for name in names(self.kernel.module.Inputs) if name not in CLOCK]

    @property
    def outputs(self) -> list[str]:
        """Flat outputs, in order."""
        return names(self.kernel.module.Outputs)


@cache
def functions(name: str) -> Functions | None:
    """Those of one of our components, compiled; None where no compiler is."""
    folder = own(name)
    component = load_component(folder)
    found = of_kernel(kernel_of(component))
    return found and found._replace(component=component, folder=folder)


def of_kernel(kernel: Kernel) -> Functions | None:
    """Those of a kernel, compiled; None where no compiler is."""
    codes = over_runs(kernel)
    found = addresses(codes)
    return None if found is None else Functions(kernel=kernel, codes=codes, addresses=tuple(found))


@cache
def loop() -> Any:
    """The library that does base steps; None where no compiler is."""
    library = load_library(with_types(SOURCE.read_text("utf-8")))
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


# Where the numbers of a component are in a block: inputs, state, parameters, and what its steps need of these.


class Room:
    """Places that are taken one after the other, and columns, which are arrays."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.memories: list[int] = []  # numbers in each column that is array memory; 0 for a table

    def take(self, count: int) -> int:
        """The first of so many free places, which are then taken."""
        self.size += count
        return self.size - count

    def column(self, size: int) -> int:
        """A new column; array memory has a size."""
        self.memories.append(size)
        return len(self.memories) - 1


class Places(NamedTuple):
    """Where the numbers of a component are, and the calls of its functions: `initial`, `constants`, `advance`."""

    functions: Functions
    buffered: int  # first input in the buffer
    own: int  # first input that it has taken
    output: int  # first output
    time: int  # behind it is the step
    par: list[int]  # of each entry of its parameters
    tables: dict[int, int]  # column of each entry of its parameters that is a table
    calls: list[Any]


def places(found: Functions, room: Room, buffered: int, own: int, output: int) -> Places:
    """Places of a component whose inputs and outputs have theirs."""
    module, time = found.kernel.module, room.take(2)
    clock = [name for name in CLOCK if name in fields(module.Inputs)]
    given = [*(time + CLOCK.index(name) for name in clock), *range(own, own + len(found.inputs))]
    kinds, entries = fields(module.Parameters), names(module.Parameters)
    is_table = [name in kinds and kinds[name].kind == "table" for name in entries]
    par = [room.column(0) if is_one else room.take(1) for is_one in is_table]
    state = [
        room.column(len(entry)) if isinstance(entry, list) else room.take(1)
        for entry in results(found.codes.initial)[: len(names(module.State))]
    ]
    made = [*state, *range(output, output + len(found.outputs))]
    constants = [*of_constants(found.codes.constants, par, room)]
    calls = [
        call(found, 0, [*given, *par], made),
        call(found, 1, par, constants),
        call(found, 2, [*state, *given, *constants], made),
    ]
    tables = {k: place for k, place in enumerate(par) if is_table[k]}
    return Places(
        functions=found, buffered=buffered, own=own, output=output, time=time, par=par, tables=tables, calls=calls
    )


def of_constants(code: Code, par: Sequence[int], room: Room) -> Iterator[int]:
    """Places of what a step needs of the parameters; a table stays where it is."""
    taken = {symbol.id: place for symbol, place in zip(code.symbols, par)}
    for entry in results(code):
        array = held(entry)
        yield taken[array.id] if array is not None else room.take(1)


def structure(p: Places, period: float, **more: Any) -> Any:
    """Structure of a component in C, with `more` of its fields; `period` is that of its samples or steps [s]."""
    initial, constants, advance = p.calls
    found = p.functions
    return fill_structure(
        Part,
        constants=constants,
        initial=initial,
        advance=advance,
        ranges=ranges(p),
        survives=found.component.survives,
        buffered=p.buffered,
        own=p.own,
        input_count=len(found.inputs),
        output=p.output,
        output_count=len(found.outputs),
        time=p.time,
        dt=p.time + 1,
        period=period,
        **more,
    )


def ranges(p: Places) -> list[Any]:
    """Inputs that have a range, where the component does not take others."""
    ports = () if p.functions.component.survives else p.functions.component.of("input")
    found = [(k, port) for k, port in enumerate(ports, p.own) if (port.min, port.max) != (None, None)]
    ends = [(k, -inf if port.min is None else port.min, inf if port.max is None else port.max) for k, port in found]
    return [Range(*end) for end in ends]


def table(entry: Sequence[float], width: int) -> npt.NDArray[np.float64]:
    """A table that all runs of a vector have: (numbers, runs)."""
    return np.repeat(np.array(entry, dtype=np.float64)[:, None], width, axis=1)


def entries_of(found: Functions, values: Mapping[str, Any]) -> list[Any]:
    """Flat entries of the record of parameters; a table is a list."""
    return [values[name] for name in names(found.kernel.module.Parameters)]


def aligned_zeros(rows: int, width: int) -> npt.NDArray[np.float64]:
    """Zeros (rows, width) that begin where a vector may."""
    raw = np.zeros((rows + 1) * width)
    first = -raw.ctypes.data % (8 * width) // 8
    return raw[first : first + rows * width].reshape(rows, width)


def results(code: Code) -> list[Any]:
    """Entries of all that a function returns."""
    return [entry for _, row in code.graph.results for entry in row]


def call(found: Functions, which: int, taken: Sequence[int], made: Sequence[int]) -> Any:
    """Call a C function; arrays that it returns stay where they are."""
    code: Code = found.codes[which]
    at = ints([*taken, *(place for entry, place in zip(results(code), made) if not is_array(entry))])
    return Call(found.addresses[which], at, code.c.constants.ctypes.data)


# One component alone over the samples of many records.


Floats = npt.NDArray[np.float64]
THREADS = 2  # more than memory can feed help little


def filter_runs(
    found: Functions,
    values: Mapping[str, Any],
    inputs: Sequence[Floats],
    chosen: Sequence[int],
    start: float,
    step: float,
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Chosen outputs (runs, outputs, samples) of a component, and which runs failed; each input is (runs, samples).

    `values` are those of the fields of its parameters; the first sample is at `start`, each after a `step` [s].
    """
    runs, samples = inputs[0].shape
    data, failed = np.empty((runs, len(chosen), samples)), np.zeros(runs, dtype=bool)
    room, c = Room(0), loop()
    lost, own, output = map(room.take, (1, len(inputs), len(found.outputs)))
    at = places(found, room, own, own, output)
    part, grid = structure(at, step), Loop(start=start, base_step=step, failed=lost)
    signals = (Signal * len(inputs))(*(Signal(x.ctypes.data, *x.strides) for x in inputs))
    recorded, width = ints(output + k for k in chosen), c.width()

    def do(first: int) -> None:
        """The runs from one on that fit into a vector."""
        count = min(width, runs - first)
        v, arrays = aligned_zeros(room.size, width), [np.zeros((size, width)) for size in room.memories]
        for k, entry in enumerate(entries_of(found, values)):
            if k in at.tables:
                arrays[at.tables[k]] = table(entry, width)
            else:
                v[at.par[k]] = entry
        block = Runs(columns=columns_in_c(arrays), count=count, v=v.ctypes.data, data=data.ctypes.data)
        c.prepare(part, block)
        c.filter(grid, block, part, signals, first, recorded, len(chosen), samples)
        failed[first : first + count] = v[lost, :count] != 0.0

    with ThreadPoolExecutor(THREADS) as threads:
        [*threads.map(do, range(0, runs, width))]
    return data, failed
