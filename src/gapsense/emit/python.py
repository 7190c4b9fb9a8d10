"""Print a traced graph as scalar Python (stdlib only), or as numpy code over N runs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from gapsense.emit.names import renamed
from gapsense.emit.printer import Printer
from gapsense.records import names
from gapsense.trace import Expr, Region


class Python(Printer):
    """Scalar Python that needs the standard library only."""

    head = """from bisect import bisect_left
from math import cos, exp, floor, inf, log, nan, sin, sqrt, tanh
"""
    forms: Mapping[str, str] = MappingProxyType(
        {
            "unary": "{op}({b[0]})",
            "fabs": "abs({b[0]})",
            "floor": "float(floor({b[0]}))",
            "neg": "(-{a[0]})",
            "not": "(not {a[0]})",
            "where": "({a[1]} if {b[0]} else {a[2]})",
            "locate": "(bisect_left({a[0]}, {b[1]}, 1, len({a[0]}) - 1) - 1)",
            "whole": "int({0})",
            "table": "{a[0]}[{i}{shift}]",
            "load": "{a[0]}[{i}{shift}]",
            "store": "{a[0]}[{i}{shift}] = {b[2]}",
        }
    )
    extra_argument = ""

    def branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """As in `Printer`."""
        self.block(f"if {self.bare(c)}:", regions[0], targets, a)
        self.block("else:", regions[1], targets, b)

    def repeat(self, node: Expr, targets: list[str]) -> None:
        """As in `Printer`."""
        body, _, new, stop, limit = node.extra
        self.assign(targets, list(node.args))
        self.write(f"for _ in range({limit}):")
        self.depth += 1
        self.region(body)
        self.advance(targets, new, stop)
        self.depth -= 1

    def advance(self, targets: list[str], new: tuple[Any, ...], stop: Any) -> None:
        """End a round of a loop."""
        done = self.fresh("b")
        self.write(f"{done} = {self.bare(stop)}")
        self.write(f"{', '.join(targets)} = {', '.join(map(self.bare, new))}")
        self.write(f"if {done}:")
        self.write("    break")

    def memory(self, size: int) -> str:
        """Array memory at the start."""
        return f"[0.0] * {size}"

    def source(self) -> str:
        """The function's text; it takes and returns flat tuples."""
        g = self.graph
        for name, cls, symbols in g.arguments:
            self.text.update((s.id, f"{name}_{entry}") for s, entry in zip(symbols, names(cls)))
            unpacked = [self.text[s.id] if s.id in self.uses else "_" for s in symbols]
            if any(text != "_" for text in unpacked):
                self.write(f"{', '.join(unpacked)}{',' * (len(symbols) == 1)} = {name}")
        self.region(g.tape.root)
        self.write(f"return {', '.join(self._tuple(entries) for _, entries in g.results)}")
        arguments = ", ".join(name for name, _, _ in g.arguments)
        return f"def {g.name}({arguments}{self.extra_argument}):\n" + "\n".join(renamed(self.lines)) + "\n"

    def _tuple(self, entries: list[Any]) -> str:
        texts = [self.memory(len(e)) if isinstance(e, list) else self.ref(e) for e in entries]
        return f"({', '.join(texts)}{',' * (len(texts) == 1)})"


class Numpy(Python):
    """Numpy code over N runs at once: scalars become arrays (N,), array memory becomes (size, N)."""

    head = """from numpy import any as any_
from numpy import (
    arange, asarray, clip, cos, exp, fabs, floor, inf, log, logical_not, nan, searchsorted, sin, sqrt, tanh, where,
    zeros,
)


def locate(table, x):
    return clip(searchsorted(table, x) - 1, 0, len(table) - 2)


def row(array, index):
    # branches are computed for all runs: an index that means nothing must not fail in a run that does not use it
    return clip(index, 0, len(array) - 1)
"""
    forms: Mapping[str, str] = MappingProxyType(
        {
            "unary": "{op}({b[0]})",
            "neg": "(-{a[0]})",
            "not": "logical_not({b[0]})",
            "and": "({a[0]} & {a[1]})",
            "or": "({a[0]} | {a[1]})",
            "where": "where({b[0]}, {b[1]}, {b[2]})",
            "locate": "locate({a[0]}, {b[1]})",
            "whole": "asarray({0}).astype(int)",
            "table": "{a[0]}[row({a[0]}, {i}{shift})]",
            "load": "{a[0]}[row({a[0]}, {i}{shift}), arange(runs)]",
            "store": "{a[0]}[row({a[0]}, {i}{shift}), arange(runs)] = {b[2]}",
        }
    )
    extra_argument = ", runs"
    condition_uses = 2

    def assign(self, targets: list[str], values: list[Any]) -> None:
        """As arrays: a division of two plain numbers in a branch that no run takes would raise an error."""
        for target, value in zip(targets, values):
            self.write(f"{target} = {self.bare(value) if isinstance(value, Expr) else f'asarray({value!r})'}")

    def branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """Compute the second branch for all runs and, if any run takes it, the first."""
        self.region(regions[1])
        self.assign(targets, b)
        self.write(f"if any_({self.bare(c)}):")
        self.depth += 1
        self.region(regions[0])
        for target, value in zip(targets, a):
            self.write(f"{target} = where({self.bare(c)}, {self.bare(value)}, {target})")
        self.depth -= 1

    def repeat(self, node: Expr, targets: list[str]) -> None:
        """As in Python, with `busy` for the runs that have not stopped."""
        self.write(f"busy{targets[0]} = asarray(True)")
        super().repeat(node, targets)

    def advance(self, targets: list[str], new: tuple[Any, ...], stop: Any) -> None:
        """End a round of a loop: runs that have stopped keep what they have."""
        busy, done = f"busy{targets[0]}", self.fresh("b")
        self.write(f"{done} = {self.bare(stop)}")
        updated = ", ".join(f"where({busy}, {self.bare(n)}, {t})" for n, t in zip(new, targets))
        self.write(f"{', '.join(targets)} = {updated}")
        self.write(f"{busy} = {busy} & logical_not({done})")
        self.write(f"if not any_({busy}):")
        self.write("    break")

    def memory(self, size: int) -> str:
        """Array memory at the start."""
        return f"zeros(({size}, runs))"
