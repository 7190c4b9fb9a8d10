"""Print a traced graph: scalar Python (stdlib only), numpy code or C over many runs, C99 in double or float."""

from gapsense.emit.c import LOCATE, WHOLE_NUMBER, WITHIN, C
from gapsense.emit.lanes import Lanes
from gapsense.emit.needed import needed
from gapsense.emit.printer import Graph, indexing
from gapsense.emit.python import Numpy, Python, compiled, namespace
from gapsense.emit.split import HARMLESS_IN_C, split

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
