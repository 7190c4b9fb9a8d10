"""Of a kernel's functions, keep what some of its outputs need, and drop the rest: other outputs, and dead state.

A state is dead if neither a wanted output nor the next value of a state that lives depends on it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Annotated, Any, NamedTuple

from gapsense.kernels.emit.printer import Graph, Printer
from gapsense.kernels.layout import Field, fields, names


def needed(
    initial: Graph, step: Graph, outputs: Collection[str], printer: type[Printer]
) -> tuple[Graph, Graph, dict[str, list[str]]]:
    """The functions with these outputs only, and the entries that are left of every record, by the record's name.

    Both functions get the same inputs and parameters, in records that hold no others.
    """
    state, published = (names(cls) for cls, _ in step.results)
    wanted = [name for name in published if name in outputs]
    alive = _alive(step, set(state), wanted, printer)
    graphs = [_returning(graph, (alive, wanted)) for graph in (initial, step)]
    used = [_used(graph, printer) for graph in graphs]
    kept = {"state": [n for n in state if n in alive], "outputs": wanted}
    for name, cls, _ in initial.arguments:
        kept[name] = [entry for entry in names(cls) if any(entry in found[name] for found in used)]
    first, second = (_taking(graph, kept) for graph in graphs)
    return first, second, kept


def _alive(step: Graph, every: set[str], outputs: Collection[str], printer: type[Printer]) -> set[str]:
    """The states that the outputs depend on, today or later."""
    alive: set[str] = set()
    while (found := _used(_returning(step, (alive, outputs)), printer)["state"] & every) - alive:
        alive |= found
    return alive


def _used(graph: Graph, printer: type[Printer]) -> dict[str, set[str]]:
    """Entries of every argument that the results depend on."""
    uses = printer(graph).uses
    return {
        name: {entry for entry, symbol in zip(names(cls), symbols) if symbol.id in uses}
        for name, cls, symbols in graph.arguments
    }


def _returning(graph: Graph, wanted: Iterable[Collection[str]]) -> Graph:
    """The function with some of the entries of each record that it returns."""
    results = [_part(cls, entries, kept) for (cls, entries), kept in zip(graph.results, wanted)]
    return graph._replace(results=results)


def _taking(graph: Graph, kept: dict[str, list[str]]) -> Graph:
    """The function with some of the entries of each record that it takes."""
    return graph._replace(
        arguments=[(name, *_part(cls, symbols, kept[name])) for name, cls, symbols in graph.arguments]
    )


def _part(cls: type, values: list[Any], kept: Collection[str]) -> tuple[type, list[Any]]:
    """A record class with some of the flat entries of another, and their values."""
    layout = {name: field for name, field in fields(cls).items() if field.kind in ("memory", "table")}
    pairs = [(name, value) for name, value in zip(names(cls), values) if name in kept]
    entries = [(name, Annotated[Any, layout.get(name, Field())]) for name, _ in pairs]
    made = NamedTuple(cls.__name__, entries)  # type: ignore[misc]  # its fields are what this is about
    return made, [value for _, value in pairs]
