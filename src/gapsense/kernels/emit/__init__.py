"""Print a traced graph: scalar Python (stdlib only), C over many runs, C99 in double or float."""

from gapsense.kernels.emit.c import C
from gapsense.kernels.emit.lanes import Lanes
from gapsense.kernels.emit.printer import HARMLESS_IN_C, Graph, Printer, indexing, split
from gapsense.kernels.emit.python import Python, compile_graph, namespace

__all__ = [
    "HARMLESS_IN_C",
    "C",
    "Graph",
    "Lanes",
    "Printer",
    "Python",
    "compile_graph",
    "indexing",
    "namespace",
    "split",
]
