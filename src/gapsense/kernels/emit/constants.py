"""Split a step in two: what depends on parameters only, which is computed once, and the rest, for every step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gapsense.kernels.emit.printer import Graph, Printer, operands, regions
from gapsense.kernels.layout import names
from gapsense.kernels.trace import BOOLEAN, UNARY, Expr, Region, Tape

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
