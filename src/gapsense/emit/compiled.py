"""Generated Python, compiled and run: the one place where that happens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gapsense.emit.printer import Graph
from gapsense.emit.python import Python


def namespace(source: str, name: str) -> dict[str, Any]:
    """What the source of a module defines; `name` stands for its file in tracebacks."""
    space: dict[str, Any] = {}
    exec(compile(source, f"<{name}>", "exec"), space)
    return space


def compiled(graph: Graph, language: type[Python] = Python) -> Callable[..., Any]:
    """The function of a graph, on flat tuples, as scalar Python or as numpy code."""
    source = f"{language.head}\n\n{language(graph).source()}"
    function: Callable[..., Any] = namespace(source, f"{graph.name}, generated")[graph.name]
    return function
