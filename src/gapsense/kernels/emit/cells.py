"""Which values of a step can stand in the state itself, so that nothing is copied where nothing changes.

Each number of the state is a cell.  At first it holds what the state was.  What an `if` node gives can stand in a cell
too: where a branch changes the number, it is assigned, and else nothing happens.  A cell may be written once nothing
after that, on this way through the branches, needs what stood in it before.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from math import inf
from typing import Any, NamedTuple

from gapsense.kernels.emit.printer import Printer, regions
from gapsense.kernels.trace import Expr, Region, memory_of

Value = tuple[int, int]  # an `if` node and the place of what it gives, or another node and -1


class Use(NamedTuple):
    """Where a value is needed: in a region, at a node, or as something that an `if` node gives."""

    region: Region
    at: float
    given: Value | None = None


def _value(node: Expr) -> Value:
    return (node.args[0].id, node.extra) if node.op == "get" and node.args[0].op == "if" else (node.id, -1)


class Cells:
    """What is known of the values of a function that goes on from a state."""

    def __init__(self, printer: Printer) -> None:
        self.printer, self.root = printer, printer.graph.tape.root
        self.around: dict[int, tuple[Expr, Region]] = {}  # of a region the node that holds it, and where that is
        self.users: dict[Value, list[tuple[Use, Expr | None]]] = defaultdict(list)  # None: it is not printed into these
        self.branches: list[tuple[Expr, Region]] = []  # that are not in a loop
        self._walk(self.root, is_in_loop=False)
        for _, entries in printer.graph.results:
            for entry in entries:
                self._note(entry, Use(self.root, inf))

    def _walk(self, region: Region, is_in_loop: bool) -> None:
        for node in region.nodes:
            if node.id not in self.printer.uses:
                continue
            for inner in regions(node):
                self.around[id(inner)] = node, region
                self._walk(inner, is_in_loop or node.op == "loop")
            self._note_operands(node, region)
            if node.op == "if" and not is_in_loop:
                self.branches.append((node, region))

    def _note_operands(self, node: Expr, region: Region) -> None:
        live = self.printer.live.get(node.id, {})
        if node.op == "if":
            self._note(node.args[0], Use(region, node.id))
            for k, pair in enumerate(node.extra[2].values()):
                for value, branch in zip(pair, node.extra) if k in live else ():
                    self._note(value, Use(branch, node.id, (node.id, k)))
        elif node.op == "loop":
            body, _, new, stop, _ = node.extra
            for k in live:
                self._note(node.args[k], Use(region, node.id))
                self._note(new[k], Use(body, inf))
            self._note(stop, Use(body, inf))
        elif node.op != "get":
            for value in node.args:
                self._note(value, Use(region, node.id), node)

    def _note(self, value: Any, use: Use, user: Expr | None = None) -> None:
        if isinstance(value, Expr):
            self.users[_value(value)].append((use, user))

    def _uses(self, value: Value) -> Iterator[Use]:
        """Where a value is needed, and where an expression that needs it may be printed instead."""
        for use, user in self.users[value]:
            yield use
            if user is not None and self.printer.may_be_inline(user):
                yield from self._uses(_value(user))

    def find_cells(self, state: list[Expr], results: list[Any], is_whole: Callable[[Any], bool]) -> dict[Value, Expr]:
        """Of values that `if` nodes give, and that can stand in the state, the symbol of the state where they do.

        Whole numbers, as which truth values are kept too, cannot.
        """
        standing = {symbol.id: [(symbol.id, -1)] for symbol in state}  # in each cell
        symbols = {symbol.id: symbol for symbol in state}
        cell_of: dict[Value, int] = {(symbol.id, -1): symbol.id for symbol in state}
        wanted = {_value(value): s.id for s, value in zip(state, results) if isinstance(value, Expr)}
        for node, region in self.branches:
            for k, pair in enumerate(node.extra[2].values()):
                if k not in self.printer.live[node.id] or memory_of(pair[0]) is not None:
                    continue
                if all(map(is_whole, pair)):
                    continue
                own = [cell_of.get(_value(value)) if isinstance(value, Expr) else None for value in pair]
                for cell in dict.fromkeys((*own, wanted.get((node.id, k)))):
                    written = [branch for branch, has in zip(node.extra, own) if has != cell]
                    if cell is not None and self._is_free(standing[cell], (node.id, k), region, written):
                        standing[cell].append((node.id, k))
                        cell_of[node.id, k] = cell
                        break
        return {value: symbols[cell] for value, cell in cell_of.items() if value[1] >= 0}

    def _is_free(self, standing: list[Value], given: Value, region: Region, written: list[Region]) -> bool:
        """Whether all that stands in a cell is done with where an `if` node of a region gives something.

        What a branch gives besides may be printed after that, if the branch writes the cell.
        """
        way, others = [*self._way(region, given[0])], {id(branch) for branch in written}
        return not any(
            self._is_after(use, way)
            or (use.given is not None and use.given[0] == given[0] and use.given != given and id(use.region) in others)
            for value in standing
            for use in self._uses(value)
        )

    def _is_after(self, use: Use, way: list[tuple[Region, float]]) -> bool:
        """Whether the use comes after a place, and is not in another branch."""
        own = {id(region): at for region, at in self._way(use.region, use.at)}
        return next(own[id(region)] > at for region, at in way if id(region) in own)

    def _way(self, region: Region, at: float) -> Iterator[tuple[Region, float]]:
        """A place in its region, and in those around it."""
        yield region, at
        while region is not self.root:
            node, region = self.around[id(region)]
            yield region, node.id
