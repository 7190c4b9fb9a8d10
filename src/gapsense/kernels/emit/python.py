"""Print a traced graph as scalar Python (stdlib only) or as numpy code over N runs, and compile it: only here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gapsense.kernels.emit.choices import Choosing
from gapsense.kernels.emit.names import WORD, renamed
from gapsense.kernels.emit.printer import Graph, Loop, Printer
from gapsense.kernels.layout import names
from gapsense.kernels.trace import Expr, Region


class Python(Choosing):
    """Scalar Python that needs the standard library only."""

    head = """from bisect import bisect_left
from math import cos, exp, floor, inf, log, nan, sin, sqrt, tanh
"""
    forms = Printer.forms | {
        "fabs": "abs({b[0]})",
        "floor": "float(floor({b[0]}))",
        "not": "(not {a[0]})",
        "where": "({a[1]} if {b[0]} else {a[2]})",
        "locate": "(bisect_left({a[0]}, {b[1]}, 1, len({a[0]}) - 1) - 1)",
        "whole": "int({0})",
    }
    extra_argument = ""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.limits: set[int] = set()  # of loops; to make a range takes longer than a round

    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        names, chosen, others = self.gathered(c)
        self.block(f"if {self.bare(c)}:", regions[0], [*targets, *names], [*a, *chosen])
        self.block("else:", regions[1], [*targets, *names], [*b, *others])

    def _repeat(self, loop: Loop) -> None:
        self._start(loop)
        self.limits.add(loop.limit)
        self.write(f"for _ in rounds_{loop.limit}:")
        self.depth += 1
        self.region(loop.body)
        self._advance(loop)
        self.depth -= 1

    def _start(self, loop: Loop) -> None:
        """Give the variables their first values, but for those that nothing reads before the first round ends."""
        started = [k for k, variable in enumerate(loop.variables) if variable.id in self.uses]
        self.assign([loop.targets[k] for k in started], [loop.starts[k] for k in started])

    def _advance(self, loop: Loop) -> None:
        """End a round of a loop: all new values first, of which most become the variables without a copy."""
        stop, values, new = self.bare(loop.stop), [*map(self.bare, loop.new)], [self.fresh() for _ in loop.new]
        if not {*loop.targets}.isdisjoint(WORD.findall(stop)):
            stop = self._let(loop.stop, stop)
        for target, value in (*zip(new, values), *zip(loop.targets, new)):
            self.write(f"{target} = {value}")
        after = dict(zip(values, loop.targets))  # of a value that has a name, what it has become
        self.write(f"if {WORD.sub(lambda word: after.get(word[0], word[0]), stop)}:")
        self.write("    break")

    def _memory(self, size: int) -> str:
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
        rounds = "".join(f"rounds_{limit} = range({limit})\n" for limit in sorted(self.limits))
        opening = f"def {g.name}({arguments}{self.extra_argument}):"
        return "\n".join([rounds + opening, *renamed(self.lines), ""])

    def _tuple(self, entries: list[Any]) -> str:
        texts = [self._memory(len(e)) if isinstance(e, list) else self.ref(e) for e in entries]
        return f"({', '.join(texts)}{',' * (len(texts) == 1)})"


class Numpy(Python):
    """Numpy code over N runs at once: scalars become arrays (N,), array memory becomes (size, N)."""

    head = """from numpy import all as all_
from numpy import any as any_
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
    forms = Printer.forms | {
        "not": "logical_not({b[0]})",
        "and": "({a[0]} & {a[1]})",
        "or": "({a[0]} | {a[1]})",
        "where": "where({b[0]}, {b[1]}, {b[2]})",
        "locate": "locate({a[0]}, {b[1]})",
        "whole": "asarray({0}).astype(int)",
        "table": "{a[0]}[row({a[0]}, {i})]",
        "load": "{a[0]}[row({a[0]}, {i}), arange(runs)]",
        "store": "{a[0]}[row({a[0]}, {i}), arange(runs)] = {b[2]}",
    }
    extra_argument = ", runs"
    condition_uses = 2
    region, block = Printer.region, Printer.block  # both sides of a choice are computed anyway
    taken = ""  # condition of the branches that are being printed

    def assign(self, targets: list[str], values: list[Any]) -> None:
        """As arrays."""
        for target, value in zip(targets, map(self.array, values)):
            self.write(f"{target} = {value}")

    def array(self, value: Any) -> str:
        """Text of an array: a division of two plain numbers in a branch that no run takes would raise an error."""
        return self.bare(value) if isinstance(value, Expr) else f"asarray({value!r})"

    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """Compute each branch for all runs if any run takes it, and choose if both are taken."""
        everyone, outer = self.fresh("b"), self.taken
        self.write(f"{everyone} = all_({self.bare(c)})")
        self.taken = self._both(outer, f"logical_not({self.bare(c)})")
        self.block(f"if not {everyone}:", regions[1], targets, b)
        self.taken = self._both(outer, self.ref(c))
        self.write(f"if {everyone} or any_({self.bare(c)}):")
        self.depth += 1
        self.region(regions[0])
        self.taken = outer
        for target, value in zip(targets, map(self.array, a)):
            self.write(f"{target} = {value} if {everyone} else where({self.bare(c)}, {value}, {target})")
        self.depth -= 1

    @staticmethod
    def _both(outer: str, condition: str) -> str:
        return f"({outer} & {condition})" if outer else condition

    def expression(self, node: Expr) -> str:
        """Text of an operation; a store in a branch changes the memory of the runs that take it."""
        text = super().expression(node)
        if node.op != "store" or not self.taken:
            return text
        element, value = text.split(" = ", 1)
        return f"{element} = where({self.taken}, {value}, {element})"

    def _repeat(self, loop: Loop) -> None:
        outer, self.taken = self.taken, self._both(self.taken, f"busy{loop.targets[0]}")
        super()._repeat(loop)
        self.taken = outer

    def _start(self, loop: Loop) -> None:
        """All variables, and `busy` for the runs that have not stopped."""
        self.write(f"busy{loop.targets[0]} = asarray(True)")
        self.assign(loop.targets, loop.starts)

    def _advance(self, loop: Loop) -> None:
        """End a round of a loop: runs that have stopped keep what they have."""
        busy, done = f"busy{loop.targets[0]}", self.fresh("b")
        self.write(f"{done} = {self.bare(loop.stop)}")
        updated = ", ".join(f"where({busy}, {self.bare(n)}, {t})" for n, t in zip(loop.new, loop.targets))
        self.write(f"{', '.join(loop.targets)} = {updated}")
        self.write(f"{busy} = {busy} & logical_not({done})")
        self.write(f"if not any_({busy}):")
        self.write("    break")

    def _memory(self, size: int) -> str:
        return f"zeros(({size}, runs))"


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
