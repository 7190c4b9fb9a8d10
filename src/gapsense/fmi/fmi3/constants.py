"""The C source `arrays.c`: what hosts that know arrays have besides the ports, see `native/c/arrays.h`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gapsense.fmi.fmi3.variables import FLAG, Shape, Tables, motion, places
from gapsense.fmi.native.headers import literal
from gapsense.fmi.ports import Component
from gapsense.kernels.emit import C
from gapsense.kernels.kernel import Kernel, trace
from gapsense.kernels.layout import fields

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
    data += array("Table", "tables", (f"{{{t.port}, {t.rows}, shipped_{t.port}, {n}}}" for t, n in zip(found, rows)))
    first = len(component.ports) + 1 + sum(1 + table.columns for table in found)
    ends = [sum(shape.size * (shape.size + 1) // 2 for shape in own[: k + 1]) for k in range(len(own))]
    if ends and ends[-1] > MOST_ENTRIES:
        raise ValueError(f"{component.name}: arrays of {ends[-1]} numbers; at most {MOST_ENTRIES} fit. Give fewer.")
    starts = enumerate(zip(own, (0, *ends)), first)
    data += array("Matrix", "matrices", (f"{{{literal(s.name)}, {k}, {s.size}, {start}}}" for k, (s, start) in starts))
    signals, index = motion(component), {port.name: k for k, port in enumerate(component.ports)}
    if signals:
        data += array("int", "signals", (str(index[port.name]) for port in signals))
        data.append(f"static const Motion motion = {{{first + len(own)}, {index[FLAG]}, signals, {len(signals)}}};\n")
    return SOURCE.format(
        kernel=kernel_c(kernel),
        data="\n".join(data),
        time=len(component.ports),
        motion="&motion" if signals else "NULL",
        tables="tables" if found else "NULL",
        table_count=len(found),
        matrices="matrices" if own else "NULL",
        matrix_count=len(own),
        function=f"{kernel.name}_arrays" if own else "NULL",
    )


def kernel_c(kernel: Kernel) -> str:
    """The function that makes the matrices; nothing if there are none."""
    text = source(kernel)
    return C.module(f"static {text}") if text else ""


def numbers(name: str, columns: Sequence[Sequence[float]]) -> str:
    """A constant array of all columns."""
    values = ", ".join(repr(float(value)) for column in columns for value in column)
    return f"static const double {name}[] = {{{values}}};\n"


def array(kind: str, name: str, items: Iterable[str]) -> list[str]:
    """A constant array; nothing for an empty one, which C does not have."""
    lines = "".join(f"    {item},\n" for item in items)
    return [f"static const {kind} {name}[] = {{\n{lines}}};\n"] if lines else []


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
