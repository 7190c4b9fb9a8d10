"""Print a traced graph: scalar Python (stdlib only), C over many runs, C99 in double or float."""

from gapsense.kernels.emit.c import AS_WRITTEN, INCLUDES, LOCATE, WHOLE_NUMBER, WITHIN, C, Typed, held, number, same
from gapsense.kernels.emit.lanes import Lanes
from gapsense.kernels.emit.printer import HARMLESS_IN_C, Graph, Printer, indexing, split
from gapsense.kernels.emit.python import Python, compiled, namespace

__all__ = [
    "AS_WRITTEN",
    "HARMLESS_IN_C",
    "INCLUDES",
    "LOCATE",
    "WHOLE_NUMBER",
    "WITHIN",
    "C",
    "Graph",
    "Lanes",
    "Printer",
    "Python",
    "Typed",
    "compiled",
    "held",
    "indexing",
    "namespace",
    "number",
    "same",
    "split",
]
