"""Of a kernel's functions, keep what some outputs need, and split off what depends on parameters only.

Dropped are other outputs and dead state, on which neither a wanted output nor the next value of a live state depends.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Annotated, Any, NamedTuple

from gapsense.kernels.emit.printer import Graph, Printer, operands, regions
from gapsense.kernels.layout import Field, fields, names
from gapsense.kernels.trace import BOOLEAN, UNARY, Expr, Region, Tape


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


# Split a step in two: what depends on parameters only, for once, and the rest, for every step.


STRUCTURE = ("in", "var", "if", "loop", "get", "store")
MOVED_WHOLE = ("if", "get")
HARMLESS = ("+", "-", "*", "neg", "fabs", "where", *BOOLEAN)  # no error, so they may be done for a branch not taken
HARMLESS_IN_C = (*HARMLESS, "/", *UNARY)  # there is infinity, and what is not a number


def split(step: Graph, printer: type[Printer], harmless: tuple[str, ...] = HARMLESS) -> tuple[Graph, Graph]:
    """`constants(par)`, and `advance(state, inputs, constants)` that goes on from there to what `step` gives.

    Operations that are `harmless` are done there even if no branch is taken that needs them.
    """
    *others, (par, cls, symbols) = step.arguments
    once = Tape(step.tape.places)
    once.root.nodes = [*symbols, *_constant(step.tape.root, {s.id for s in symbols}, harmless)]
    titles = dict(zip((s.id for s in symbols), names(cls)))

    def advance(constants: list[Expr]) -> Graph:
        entries = [(titles.get(node.id, f"value_{k}"), float) for k, node in enumerate(constants)]
        record = NamedTuple("Constants", entries)  # type: ignore[misc]  # its fields are what this is about
        return Graph("advance", step.tape, [*others, ("constants", record, constants)], step.results)

    uses = printer(advance(once.root.nodes)).uses
    rest = advance([node for node in once.root.nodes if node.id in uses])
    _, record, constants = rest.arguments[-1]
    return Graph("constants", once, [(par, cls, symbols)], [(record, list(constants))]), rest


def _constant(region: Region, known: set[int], harmless: tuple[str, ...], is_root: bool = True) -> Iterator[Expr]:
    """Nodes, those in branches included, that need no more than `known` ones; they become known.

    A branch on a condition of this kind is one, where it is not in a branch itself; its values follow it.
    """
    for node in region.nodes:
        may_move = is_root if node.op in MOVED_WHOLE else node.op not in STRUCTURE and (is_root or node.op in harmless)
        if may_move and known.issuperset(_needs(node, region)):
            known.add(node.id)
            yield node
        else:
            for inner in regions(node):
                yield from _constant(inner, known, harmless, is_root=False)


def _needs(node: Expr, region: Region) -> set[int]:
    """What a node needs, less what is made in its branches."""
    inner = [(n, r) for r in regions(node) for n in r.nodes]
    needed = {value.id for value, _ in operands(node, region) if isinstance(value, Expr)}
    return needed.union(*(_needs(n, r) for n, r in inner)) - {n.id for n, _ in inner}
