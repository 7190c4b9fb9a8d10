"""Choices in generated code: those on one condition share a branch, and what only one side needs is computed in it.

A kernel chooses value by value, `where(c, a, b)`, from operands that are both harmless.  Code for one run at a time is
quicker if it asks for the condition once, and computes nothing that is not chosen.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from gapsense.kernels.emit.printer import Graph, Printer, operands, regions
from gapsense.kernels.trace import Expr, Region

FIXED = ("in", "var", "if", "loop", "get", "store")  # operations that are printed where they are
MANY = 8  # operations for which a choice is worth a branch of its own

Side = tuple[int, int]  # condition, and operand of the choice on it: 1 or 2


class Choices(NamedTuple):
    """Of a region: what waits until it is needed."""

    groups: dict[int, list[Expr]]  # choices, by condition
    sides: dict[int, Side]  # of values that one side only needs


class Choosing(Printer):
    """A printer that gathers choices; its `_branch` prints what `gathered` gives too."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.choices = Choices({}, {})  # of the region that is being printed

    def region(self, region: Region) -> None:
        """Print the live nodes of a region; choices wait for others on their condition until one is needed."""
        outer, self.choices = self.choices, self._choices(region)
        waiting = {choice.id: choice for group in self.choices.groups.values() for choice in group}
        for node in region.nodes:
            if node.id in self.uses and not (node.id in waiting or node.id in self.choices.sides):
                self._choose(waiting[value] for value in _read(node, region) if value in waiting)
                self._print(node)
        self._choose(waiting.values())
        self.choices = outer

    def block(self, opening: str, region: Region, targets: list[str], values: list[Any]) -> None:
        """Print a branch: its nodes, and the values that it gives, each after what only it needs."""
        self.write(opening)
        self.depth += 1
        self.region(region)
        for target, value in zip(targets, values):
            for kept in self._kept([value]):
                self._print(kept)
            self.assign([target], [value])
        self.depth -= 1

    def gathered(self, c: Any) -> tuple[list[str], list[Any], list[Any]]:
        """Names of all choices on a condition that can be printed by now, and the operands for both cases."""
        group = self._ready(c.id) if isinstance(c, Expr) else []
        targets = [self.fresh("c") for _ in group]
        self.text.update((choice.id, target) for choice, target in zip(group, targets))
        return targets, [choice.args[1] for choice in group], [choice.args[2] for choice in group]

    def _choices(self, region: Region) -> Choices:
        """Of the live nodes of a region."""
        found = Choices({}, {})
        needed: dict[int, set[Side | None]] = {}  # by whom each value is
        for node in reversed(region.nodes):
            if node.id not in self.uses or node.id in self.text:
                continue
            side = self._side(node, needed)
            is_choice = node.op == "where" and not side and not self.is_index(node)
            if side:
                found.sides[node.id] = side
            elif is_choice:
                found.groups.setdefault(node.args[0].id, []).insert(0, node)
            for k, value in enumerate(node.args):
                if isinstance(value, Expr):
                    needed.setdefault(value.id, set()).add((node.args[0].id, k) if is_choice and k else side)
        return found

    def _side(self, node: Expr, needed: dict[int, set[Side | None]]) -> Side | None:
        """The only side that needs a node; array memory is read where it was, because it may change."""
        sides = needed.get(node.id, {None})
        is_fixed = node.op in FIXED or (node.op == "load" and node.args[0].extra != "table")
        is_elsewhere = node.id in self.far or node.id in self.leaving
        return None if is_fixed or is_elsewhere or len(sides) > 1 else next(iter(sides))

    def _choose(self, wanted: Iterable[Expr]) -> None:
        """Print choices, if they have not been, with others on their conditions that can be."""
        for choice in self._in_order(wanted):
            if choice.id not in self.text:
                if self._is_worth_a_branch(self._ready(choice.args[0].id)):
                    self._branch(choice.args[0], (Region(), Region()), [], [], [])
                else:
                    for value in (*self._kept(choice.args), choice):
                        self._print(value)

    def _in_order(self, wanted: Iterable[Expr]) -> list[Expr]:
        """Choices that are not printed yet, each after those that it reads."""
        found: dict[int, Expr] = {}
        pending = [*wanted]
        while pending:
            choice = pending.pop()
            if choice.id not in self.text and choice.id not in found:
                found[choice.id] = choice
                pending += self._missing(choice)
        return [found[k] for k in sorted(found)]

    def _is_worth_a_branch(self, group: list[Expr]) -> bool:
        """By what the condition costs to ask again, and a name for what could do without."""
        kept = [*self._kept(value for choice in group for value in choice.args)]
        inline = sum(self.uses[choice.id] == 1 and choice.id not in self.far for choice in group)
        return 5 * (len(group) - 1) > 4 * inline or len(kept) >= MANY or any(self.uses[v.id] > 1 for v in kept)

    def _ready(self, condition: int) -> list[Expr]:
        """Choices on a condition that read nothing but what is printed, and each other."""
        ready: list[Expr] = []
        for choice in self.choices.groups.get(condition, []):
            if choice.id not in self.text and {v.id for v in self._missing(choice)} <= {c.id for c in ready}:
                ready.append(choice)
        return ready

    def _missing(self, choice: Expr) -> list[Expr]:
        """What a choice, and what only one of its sides needs, read of values that are not printed yet."""
        read = [*choice.args, *(value for kept in self._kept(choice.args) for value in kept.args)]
        return [v for v in read if isinstance(v, Expr) and v.id not in self.text and v.id not in self.choices.sides]

    def _kept(self, values: Iterable[Any]) -> list[Expr]:
        """Those of some values, and of what they are made from, that were kept for one side; in order."""
        found: dict[int, Expr] = {}
        pending = [*values]
        while pending:
            value = pending.pop()
            if self._is_kept(value) and value.id not in found:
                found[value.id] = value
                pending += value.args
        return [found[k] for k in sorted(found)]

    def _is_kept(self, value: Any) -> bool:
        return isinstance(value, Expr) and value.id in self.choices.sides and value.id not in self.text

    def _print(self, node: Expr) -> None:
        if node.id not in self.text:
            self._node(node)


def _read(node: Expr, region: Region) -> Iterator[int]:
    """What a node reads, in its branches or its loop body too."""
    yield from (value.id for value, _ in operands(node, region) if isinstance(value, Expr))
    for inner in regions(node):
        for other in inner.nodes:
            yield from _read(other, inner)
