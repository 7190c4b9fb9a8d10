"""Print a traced graph as scalar Python (stdlib only), as numpy code over N runs, or as C99 in double or float."""

from gapsense.emit.c import LOCATE, C
from gapsense.emit.needed import needed
from gapsense.emit.printer import Graph
from gapsense.emit.python import Numpy, Python, compiled, namespace
from gapsense.emit.split import HARMLESS_IN_C, split

__all__ = ["HARMLESS_IN_C", "LOCATE", "C", "Graph", "Numpy", "Python", "compiled", "namespace", "needed", "split"]
