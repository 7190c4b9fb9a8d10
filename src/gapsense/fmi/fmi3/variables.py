"""The variables of an FMU of FMI 3.0: those of the port table, the time, tables as arrays, arrays of the state.

A port keeps the value reference that it has in FMI 2.0, its place in the table; what FMI 3.0 adds comes after.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from gapsense.fmi.native.headers import array, literal
from gapsense.fmi.ports import Component, Port
from gapsense.fmi.tables import HEADER, heads
from gapsense.kernels.emit import C
from gapsense.kernels.kernel import Kernel, trace
from gapsense.kernels.layout import fields

TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}
SMOOTHED, FLAG = "smoothed_", "smoothed_published"
MOTION_ROWS = 2048  # of a smoothed motion, as in arrays.h
MOST_ROWS = 1_000_000  # of a table that is given as arrays
FEWEST_ROWS = 2


class Shape(NamedTuple):
    """An array that the kernel's function `arrays` makes of its state: a symmetric matrix."""

    name: str
    size: int
    of: tuple[str, ...]  # outputs, the names of its rows


class Variable(NamedTuple):
    """One variable."""

    name: str
    reference: int
    causality: str
    description: str
    type: str = "Float64"
    variability: str = "continuous"
    unit: str = ""  # nothing: it has none, or not one for all elements
    start: tuple[Any, ...] = ()
    min: float | int | None = None
    max: float | int | None = None
    nominal: float | None = None
    choices: tuple[str, ...] = ()  # items of an enumeration, numbered from 1 on
    rows: int | None = None  # value reference of the parameter that is the length of a table
    shape: tuple[int, ...] = ()  # of an array that has always the same
    feedthrough: tuple[str, ...] = ()  # inputs that an output follows at once


class Table(NamedTuple):
    """Where the arrays of a parameter that names a CSV file are."""

    port: int  # value reference of that parameter
    rows: int  # value reference of the number of rows; the columns come after it
    columns: int


Tables = Mapping[str, Sequence[Sequence[float]]]  # shipped columns, by parameter


def motion(component: Component) -> list[Port]:
    """Signals of a smoothed motion, the time first, of a component that publishes one sample by sample."""
    signals = [port for port in component.of("output") if port.name.startswith(SMOOTHED)]
    return [port for port in signals if port.name != FLAG] if any(port.name == FLAG for port in signals) else []


def variables(component: Component, tables: Tables, arrays: Sequence[Shape] = ()) -> list[Variable]:
    """All variables in the order of their value references."""
    found = [_of_port(port, k) for k, port in enumerate(component.ports)]
    found.append(Variable("time", len(found), "independent", "Time", unit="s"))
    for port in component.ports:
        if port.columns:
            found += _of_table(port, tables[port.name], len(found))
    for shape in arrays:
        found.append(_of_array(shape, component, len(found)))
    return [*found, *_of_motion(motion(component), len(found))]


def places(component: Component) -> Iterator[Table]:
    """Where the arrays of the tables are among the variables."""
    at = len(component.ports) + 1
    for k, port in enumerate(component.ports):
        if port.columns:
            columns = len(heads(port.columns))
            yield Table(k, at, columns)
            at += 1 + columns


def _of_port(port: Port, reference: int) -> Variable:
    variable = Variable(
        *(port.name, reference, port.causality, port.description),
        type=TYPES[port.kind],
        variability=port.variability,
        start=() if port.start is None else (port.start,),
        feedthrough=port.feedthrough,
    )
    if port.kind in ("Real", "Integer"):
        nominal, unit = (port.nominal, port.unit) if port.kind == "Real" else (None, "")
        variable = variable._replace(unit=unit, min=port.min, max=port.max, nominal=nominal)
    if port.choices:
        at = port.choices.index(port.start) + 1
        variable = variable._replace(type="Enumeration", start=(at,), choices=port.choices)
    return variable


def _of_table(port: Port, columns: Sequence[Sequence[float]], first: int) -> list[Variable]:
    told = f"the table while {port.name} has its start value"
    about = f"Rows of the arrays that are {told}"
    size = Variable(f"{port.name}.rows", first, "structuralParameter", about, type="UInt64", variability="fixed")
    found = [size._replace(start=(len(columns[0]),), min=FEWEST_ROWS, max=MOST_ROWS)]
    for k, (head, values) in enumerate(zip(heads(port.columns), columns), first + 1):
        matched = HEADER.fullmatch(head)
        name, unit = (matched[1], matched[2] or "1") if matched else (head, "1")
        column = Variable(f"{port.name}.{name}", k, "parameter", f"Column {name} of {told}", variability="fixed")
        found.append(column._replace(unit=unit, start=tuple(values), rows=first))
    return found


def _of_motion(signals: Sequence[Port], first: int) -> list[Variable]:
    """How many samples the motion has that was smoothed last, and its signals; behind the samples they are zero."""
    if not signals:
        return []
    told = "Samples of the motion that was smoothed and published last, so far"
    found = [Variable("smoothed_motion.count", first, "output", told, type="Int32", variability="discrete")]
    for k, port in enumerate(signals, first + 1):
        name, about = port.name.removeprefix(SMOOTHED), f"{port.description}: of all samples of that motion"
        variable = Variable(f"smoothed_motion.{name}", k, "output", about, unit=port.unit)
        found.append(variable._replace(shape=(MOTION_ROWS,), nominal=port.nominal))
    return [variable._replace(feedthrough=signals[0].feedthrough) for variable in found]


def _of_array(shape: Shape, component: Component, reference: int) -> Variable:
    told = f"{shape.name.replace('_', ' ').capitalize()} of {', '.join(shape.of)}, each in its unit"
    follows = {name for port in component.of("output") if port.name in shape.of for name in port.feedthrough}
    inputs = tuple(port.name for port in component.of("input") if port.name in follows)
    size = (shape.size, shape.size)
    return Variable(shape.name, reference, "output", told, shape=size, feedthrough=inputs)


# The C source `arrays.c`: what hosts that know arrays have besides the ports, see `native/c/arrays.h`.


MOST_ENTRIES = 64  # as in arrays.h
SOURCE = """/* The arrays of a component, generated from its port table and its kernel. */
#include "arrays.h"

{kernel}{data}
const Arrays arrays = {{
    .time = {time},
    .tables = {tables},
    .table_count = {table_count},
    .matrices = {matrices},
    .matrix_count = {matrix_count},
    .motion = {motion},
    .kernel = {function},
}};
"""


def arrays_c(component: Component, kernel: Kernel, tables: Tables) -> str:
    """Text of the file; `tables` are the columns that are shipped."""
    found, own = [*places(component)], shapes(kernel)
    data = [numbers(f"shipped_{table.port}", tables[component.ports[table.port].name]) for table in found]
    rows = [len(tables[component.ports[table.port].name][0]) for table in found]
    data.append(
        array("Table", "tables", (f"{{{t.port}, {t.rows}, shipped_{t.port}, {n}}}" for t, n in zip(found, rows)))
    )
    first = len(component.ports) + 1 + sum(1 + table.columns for table in found)
    ends = [sum(shape.size * (shape.size + 1) // 2 for shape in own[: k + 1]) for k in range(len(own))]
    if ends and ends[-1] > MOST_ENTRIES:
        raise ValueError(f"{component.name}: arrays of {ends[-1]} numbers; at most {MOST_ENTRIES} fit. Give fewer.")
    starts = enumerate(zip(own, (0, *ends)), first)
    data.append(
        array("Matrix", "matrices", (f"{{{literal(s.name)}, {k}, {s.size}, {start}}}" for k, (s, start) in starts))
    )
    signals, index = motion(component), {port.name: k for k, port in enumerate(component.ports)}
    if signals:
        data.append(array("int", "signals", (str(index[port.name]) for port in signals)))
        data.append(f"static const Motion motion = {{{first + len(own)}, {index[FLAG]}, signals, {len(signals)}}};\n")
    return SOURCE.format(
        kernel=C.module(f"static {source(kernel)}") if own else "",
        data="\n".join(filter(None, data)),
        time=len(component.ports),
        motion="&motion" if signals else "NULL",
        tables="tables" if found else "NULL",
        table_count=len(found),
        matrices="matrices" if own else "NULL",
        matrix_count=len(own),
        function=f"{kernel.name}_arrays" if own else "NULL",
    )


def numbers(name: str, columns: Sequence[Sequence[float]]) -> str:
    """A constant array of all columns."""
    values = ", ".join(repr(float(value)) for column in columns for value in column)
    return f"static const double {name}[] = {{{values}}};\n"


# Arrays made of a kernel's state for hosts that know arrays.
#
# A kernel may have a record `Arrays`, a function `arrays(state, par)` that gives one, and `ROWS`: the outputs that the
# rows and columns of its covariances stand for.


def shapes(kernel: Kernel) -> list[Shape]:
    """Names and sizes."""
    if not hasattr(kernel.module, "arrays"):
        return []
    return [Shape(name, field.size, kernel.module.ROWS) for name, field in fields(kernel.module.Arrays).items()]


def source(kernel: Kernel) -> str:
    """C99 of `<kernel>_arrays`, to stand behind that of the kernel; it writes the upper triangles as its new state."""
    module = kernel.module
    if not hasattr(module, "arrays"):
        return ""
    graph = trace(module.arrays, {"state": module.State, "par": module.Parameters}, (module.Arrays,))
    return C(graph._replace(name=f"{kernel.name}_arrays")).source()
