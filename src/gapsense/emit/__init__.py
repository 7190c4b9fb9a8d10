"""Print a traced graph as scalar Python (stdlib only), as numpy code over N runs, or as C99 in double or float."""

from gapsense.emit.c import C
from gapsense.emit.printer import Graph
from gapsense.emit.python import Numpy, Python, compiled, namespace
from gapsense.emit.split import split

__all__ = ["C", "Graph", "Numpy", "Python", "compiled", "namespace", "split"]
