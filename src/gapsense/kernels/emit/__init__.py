"""Print a traced graph: scalar Python (stdlib only), numpy code or C over many runs, C99 in double or float."""

from gapsense.kernels.emit.c import LOCATE, WHOLE_NUMBER, WITHIN, C
from gapsense.kernels.emit.lanes import Lanes
from gapsense.kernels.emit.needed import needed
from gapsense.kernels.emit.printer import Graph, indexing
from gapsense.kernels.emit.python import Numpy, Python, compiled, namespace
from gapsense.kernels.emit.split import HARMLESS_IN_C, split

__all__ = [
    "HARMLESS_IN_C",
    "LOCATE",
    "WHOLE_NUMBER",
    "WITHIN",
    "C",
    "Graph",
    "Lanes",
    "Numpy",
    "Python",
    "compiled",
    "indexing",
    "namespace",
    "needed",
    "split",
]
