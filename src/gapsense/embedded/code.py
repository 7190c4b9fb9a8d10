"""Print the functions of a component as C that a reader can follow: records by name, the line of Python over its C."""

from __future__ import annotations

import linecache
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gapsense.kernels.emit import Graph
from gapsense.kernels.emit.c import FEW, Typed, number
from gapsense.kernels.layout import names
from gapsense.kernels.trace import Expr, Place, Region, memory_of

LONGEST_QUOTE = 100


class Function(Typed):
    """The body of a function on records that pointers lead to, `name->entry`, in float or double."""

    def __init__(
        self, graph: Graph, real: str, sizes: Mapping[str, str], memories: Mapping[str, int], is_baked: bool
    ) -> None:
        self.memories = memories  # numbers of every array memory
        super().__init__(graph, real)
        self.sizes, self.is_baked = sizes, is_baked  # of every table what holds its length
        self.quoted = ""
        self.size_of: dict[int, str] = {}  # text of the length of a table
        self.sized: set[str] = set()  # lengths that were passed on

    def memory_size(self, cls: type, entry: str) -> int:
        """Numbers of an array memory, for which there may be less room than its layout says."""
        return self.memories[entry]

    def body(self) -> list[str]:
        """Its lines."""
        for name, cls, symbols in self.graph.arguments:
            for entry, symbol in zip(names(cls), symbols):
                self._unpack_entry(name, entry, symbol)
        self.use_state()
        self.region(self.graph.tape.root)
        targets = ("constants",) if len(self.graph.results) == 1 else ("state", "outputs")
        for name, (cls, entries) in reversed([*zip(targets, self.graph.results)]):
            self._give(name, dict(zip(names(cls), entries)))
        return self.lines

    def _unpack_entry(self, name: str, entry: str, symbol: Expr) -> None:
        at, text = f"{name}->{entry}", f"{name}_{entry}"
        if symbol.extra == "table":
            before = "" if self.is_baked else f"{name}->"
            text = before + entry
            self.size_of[symbol.id] = before + self.sizes[entry]
        elif symbol.extra == "memory" or name != "state" or len(self.state()) > FEW:
            text = at
        elif symbol.id in self.uses:
            self.write(f"const {self.real} {text} = {at};")
        self.text[symbol.id] = text

    def _give(self, name: str, values: Mapping[str, Any]) -> None:
        for entry, value in values.items():
            if isinstance(value, list):
                self.write(
                    f"for (int k = 0; k < {self.memories[entry]}; k++) {name}->{entry}[k] = {self._number(0.0)};"
                )
        numbers = {f"{name}->{entry}": value for entry, value in values.items() if memory_of(value) is None}
        numbers = {target: value for target, value in numbers.items() if not isinstance(value, list)}
        self.put([*numbers], [*numbers.values()])
        for entry, value in values.items():
            if isinstance(value, Expr) and value.extra == "table" and self.sizes[entry] not in self.sized:
                self.sized.add(self.sizes[entry])
                self.write(f"{name}->{self.sizes[entry]} = {self.size_of[value.id]};")

    def expression(self, node: Expr) -> str:
        """Text of an operation; tables know where their lengths are."""
        if node.op != "locate":
            return super().expression(node)
        table, x = node.args
        return f"locate({self.ref(table)}, {self.size_of[table.id]}, {self.bare(x)})"

    def _let(self, node: Expr, text: str) -> str:
        self._quote(node)
        return super()._let(node, text)

    def _node(self, node: Expr) -> None:
        if node.op in ("if", "loop", "store"):
            self._quote(node)
        super()._node(node)

    def block(self, opening: str, region: Region, targets: list[str], values: list[Any]) -> None:
        """Print a branch; source lines that are quoted in it are quoted again after it."""
        super().block(opening, region, targets, values)
        self.quoted = ""

    def _quote(self, node: Expr) -> None:
        """Write the line of Python that the node is from, once."""
        place = (self.graph.tape.places or {}).get(node.id)
        text = quote(place) if place else ""
        if text and text != self.quoted:
            self.write(f"/* {text} */")
            self.quoted = text


def quote(place: Place) -> str:
    """Where a line is, and what it says, fit for a comment."""
    line = linecache.getline(place.file, place.line).strip().replace("/*", "/ *").replace("*/", "* /")
    function = "" if place.function.startswith("<") else f".{place.function}"
    return f"{Path(place.file).stem}{function}: {line[:LONGEST_QUOTE]}".rstrip()


def constant_table(name: str, values: list[float], real: str) -> Iterator[str]:
    """Lines that define a table of numbers."""
    yield f"static const {real} {name}[{len(values)}] = {{"
    for k in range(0, len(values), 6):
        yield "    " + " ".join(f"{number(value, real)}," for value in values[k : k + 6])
    yield "};"
