"""Arrays made of a kernel's state for hosts that know arrays.

A kernel `x` may have a module `x_arrays` beside it, with a record `Arrays`, a function `arrays(state, par)` that gives
one, and `ROWS`: the outputs that the rows and columns of its covariances stand for.
"""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

from gapsense.fmi.fmi3.variables import Shape
from gapsense.kernels.emit import C
from gapsense.kernels.kernel import Kernel, trace
from gapsense.kernels.layout import fields


def module_of(kernel: Kernel) -> ModuleType | None:
    """The module, if there is one."""
    name = f"{kernel.module.__name__}_arrays"
    return importlib.import_module(name) if importlib.util.find_spec(name) else None


def shapes(kernel: Kernel) -> list[Shape]:
    """Names and sizes."""
    module = module_of(kernel)
    return [Shape(name, field.size, module.ROWS) for name, field in fields(module.Arrays).items()] if module else []


def source(kernel: Kernel) -> str:
    """C99 of `<kernel>_arrays`, to stand behind that of the kernel; it writes the upper triangles as its new state."""
    module, records = module_of(kernel), kernel.module
    if module is None:
        return ""
    graph = trace(module.arrays, {"state": records.State, "par": records.Parameters}, (module.Arrays,))
    return C(graph._replace(name=f"{kernel.name}_arrays")).source()
