"""Print a traced graph as scalar Python (stdlib only), as numpy code over N runs, or as C99 in double or float."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from gapsense.records import ARRAYS, fields, names
from gapsense.trace import BOOLEAN, UNARY, Expr, Region, Tape, TraceError

LONGEST_INLINE = 90  # characters; a longer expression gets a name even if it is used once


class Graph(NamedTuple):
    """A traced function: its arguments (name, record class, symbols) and the flat entries of each record it returns."""

    name: str
    tape: Tape
    arguments: list[tuple[str, type, list[Expr]]]
    results: list[tuple[type, list[Any]]]


def operands(node: Expr, region: Region) -> Iterator[tuple[Any, Region]]:
    """Operands of a node of `region`, those in its branches or its loop body included, each with where it is read."""
    yield from ((arg, region) for arg in node.args)
    if node.op == "if":
        then, otherwise, outs = node.extra
        for a, b in outs.values():
            yield from ((a, then), (b, otherwise))
    elif node.op == "loop":
        body, _, new, stop, _ = node.extra
        yield from ((value, body) for value in (*new, stop))


def _regions(node: Expr) -> tuple[Region, ...]:
    return node.extra[:2] if node.op == "if" else node.extra[:1] if node.op == "loop" else ()


def _bare(text: str) -> str:
    """`text` without a pair of parentheses around all of it."""
    depth = 0
    for k, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return text[1:-1] if k and text[0] == "(" and k == len(text) - 1 else text
    return text


class Printer(ABC):
    """Walks the live nodes in order; subclasses say how the statements and expressions of one language look."""

    forms: Mapping[str, str]  # text of an operation with operands `a`, or `b` without outer parentheses
    condition_uses = 1  # how often the text of a condition is printed
    end = ""  # of a statement

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.lines: list[str] = []
        self.depth, self.count = 1, 0
        self.text: dict[int, str] = {}  # of every node printed so far: an expression or a name
        self.holders: dict[int, list[str]] = {}  # names of the values of `if` and `loop` nodes
        self.live: dict[int, dict[int, None]] = {}  # which values of an `if` node are used, in order
        self.uses: dict[int, int] = {}
        self.home: dict[int, Region] = {}
        self.far: set[int] = set()  # used in another region than their own: never inlined
        self._place(graph.tape.root, ())
        for _, entries in graph.results:
            for entry in entries:
                self._check_visible(entry, (graph.tape.root,))
                self._use(entry)

    def _place(self, region: Region, enclosing: tuple[Region, ...]) -> None:
        for node in region.nodes:
            self.home[node.id] = region
            for inner in _regions(node):
                self._place(inner, (*enclosing, region))
            for value, place in operands(node, region):
                self._check_visible(value, {*enclosing, region, place})
                if isinstance(value, Expr) and self.home[value.id] is not place:
                    self.far.add(value.id)

    def _check_visible(self, value: Any, regions: Any) -> None:
        if isinstance(value, Expr) and self.home.get(value.id) not in regions:
            raise TraceError(
                f"`{self.graph.name}`: a value made inside cond() or loop() is used outside; return it from there."
            )

    def _use(self, result: Any) -> None:
        """Count the uses of everything that `result` needs; a result counts twice, so that it gets a name."""
        pending = [(result, 2)]
        while pending:
            node, weight = pending.pop()
            if isinstance(node, Expr):
                is_first = node.id not in self.uses
                self.uses[node.id] = self.uses.get(node.id, 0) + weight
                if is_first:
                    pending += self._needs(node)

    def _needs(self, node: Expr) -> list[tuple[Any, int]]:
        if node.op == "get" and node.args[0].op == "if":
            holder = node.args[0]
            self.live.setdefault(holder.id, {})[node.extra] = None
            return [(holder, 1), *((value, 1) for value in [*holder.extra[2].values()][node.extra])]
        if node.op == "if":
            return [(node.args[0], self.condition_uses)]
        return [(value, 1) for value, _ in operands(node, self.home[node.id])]

    def write(self, line: str) -> None:
        """Add a line at the current depth."""
        self.lines.append("    " * self.depth + line)

    def fresh(self, letter: str = "t") -> str:
        """A new name."""
        self.count += 1
        return f"{letter}{self.count}"

    def ref(self, value: Any) -> str:
        """Text of an operand."""
        return self.text[value.id] if isinstance(value, Expr) else self.number(value)

    def bare(self, value: Any) -> str:
        """Text of an operand that stands alone."""
        return _bare(self.ref(value))

    def region(self, region: Region) -> None:
        """Print the live nodes of a region."""
        for node in region.nodes:
            if node.id in self.uses and node.id not in self.text:
                self._node(node)

    def _node(self, node: Expr) -> None:
        if node.op == "if":
            then, otherwise, outs = node.extra
            self.holders[node.id] = [self.fresh("c") if k in self.live[node.id] else "" for k in range(len(outs))]
            live = [(self.holders[node.id][k], *[*outs.values()][k]) for k in sorted(self.live[node.id])]
            targets, a, b = map(list, zip(*live))
            self.branch(node.args[0], (then, otherwise), targets, a, b)
        elif node.op == "loop":
            self.holders[node.id] = [self.fresh("v") for _ in node.args]
            self.text.update((v.id, t) for v, t in zip(node.extra[1], self.holders[node.id]))
            self.repeat(node, self.holders[node.id])
        elif node.op == "get":
            self.text[node.id] = self.holders[node.args[0].id][node.extra]
        elif node.op == "store":
            self.text[node.id] = self.ref(node.args[0])
            self.write(self.expression(node) + self.end)
        else:
            text = self.expression(node)
            is_inline = self.uses[node.id] == 1 and node.id not in self.far and len(text) < LONGEST_INLINE
            self.text[node.id] = text if is_inline and node.op != "load" else self._let(node, _bare(text))

    def expression(self, node: Expr) -> str:
        """Text of an operation."""
        a = [self.ref(arg) for arg in node.args]
        op = "table" if node.op == "load" and node.args[0].extra == "table" else node.op
        form = self.forms.get(op, self.forms["unary"] if op in UNARY else "({a[0]} {op} {a[1]})")
        return form.format(op=op, a=a, b=[*map(_bare, a)], shift=f" + {node.extra}" if node.extra else "")

    def assign(self, targets: list[str], values: list[Any]) -> None:
        """Print `target = value` for each."""
        for target, value in zip(targets, values):
            self.write(f"{target} = {self.bare(value)}{self.end}")

    def block(self, opening: str, region: Region, targets: list[str], values: list[Any]) -> None:
        """Print a branch: its nodes, and the values it gives."""
        self.write(opening)
        self.depth += 1
        self.region(region)
        self.assign(targets, values)
        self.depth -= 1

    def number(self, value: Any) -> str:
        """Text of a constant, exact."""
        return repr(value)

    def _let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(f"{name} = {text}")
        return name

    @abstractmethod
    def branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """Print a condition: `targets` become the values `a` of the first region or `b` of the second."""

    @abstractmethod
    def repeat(self, node: Expr, targets: list[str]) -> None:
        """Print a loop; its variables are the `targets`."""

    @abstractmethod
    def source(self) -> str:
        """Text of the function."""


class Python(Printer):
    """Scalar Python that needs the standard library only."""

    head = """from bisect import bisect_left
from math import cos, exp, floor, inf, log, nan, sin, sqrt, tanh


def locate(table, x):
    return min(max(bisect_left(table, x) - 1, 0), len(table) - 2)
"""
    forms: Mapping[str, str] = MappingProxyType(
        {
            "unary": "{op}({b[0]})",
            "fabs": "abs({b[0]})",
            "floor": "float(floor({b[0]}))",
            "neg": "(-{a[0]})",
            "not": "(not {a[0]})",
            "where": "({a[1]} if {b[0]} else {a[2]})",
            "locate": "locate({a[0]}, {b[1]})",
            "table": "{a[0]}[int({b[1]}){shift}]",
            "load": "{a[0]}[int({b[1]}){shift}]",
            "store": "{a[0]}[int({b[1]})] = {b[2]}",
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
        return f"def {g.name}({arguments}{self.extra_argument}):\n" + "\n".join(self.lines) + "\n"

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
    return clip(asarray(index).astype(int), 0, len(array) - 1)
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
            "table": "{a[0]}[row({a[0]}, {a[1]}{shift})]",
            "load": "{a[0]}[row({a[0]}, {a[1]}{shift}), arange(runs)]",
            "store": "{a[0]}[row({a[0]}, {b[1]}), arange(runs)] = {b[2]}",
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


class C(Printer):
    """C99 without dependencies; `-DSINGLE` builds it in float."""

    end = ";"
    forms: Mapping[str, str] = MappingProxyType(
        {
            "unary": "F({op})({b[0]})",
            "neg": "(-{a[0]})",
            "not": "(!{a[0]})",
            "and": "({a[0]} && {a[1]})",
            "or": "({a[0]} || {a[1]})",
            "where": "({a[0]} ? {a[1]} : {a[2]})",
            "locate": "locate({a[0]}, {a[0]}_size, {b[1]})",
            "table": "{a[0]}[(int){a[1]}{shift}]",
            "load": "{a[0]}[(int){a[1]}{shift}]",
            "store": "{a[0]}[(int){a[1]}] = {b[2]}",
        }
    )
    head = """/* Build with -ffp-contract=off to get the bits of the Python code; and, where a loop starts from a
   constant and calls exp, log, sin, cos or tanh, with -fno-builtin-exp and so on: folded at compile time, these are
   rounded otherwise than by the library. */
#include <math.h>
#ifdef SINGLE
typedef float real;
#define R(x) x##f
#define F(name) name##f
#else
typedef double real;
#define R(x) x
#define F(name) name
#endif

static inline int locate(const real *table, int size, real x)
{
    int low = 0, high = size; /* first element that is not below x */
    while (low < high) {
        const int middle = (low + high) / 2;
        if (table[middle] < x) low = middle + 1; else high = middle;
    }
    low -= 1;
    return low < 0 ? 0 : low > size - 2 ? size - 2 : low;
}
"""

    def number(self, value: Any) -> str:
        """As in `Printer`."""
        if isinstance(value, bool):
            return str(int(value))
        if math.isfinite(value):
            return f"R({value!r})"
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0.0 else "(-INFINITY)"

    def _let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(f"const {'int' if node.op in (*BOOLEAN, 'locate') else 'real'} {name} = {text};")
        return name

    def branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """As in `Printer`."""
        self.write(f"real {', '.join(targets)};")
        self.block(f"if ({self.bare(c)}) {{", regions[0], targets, a)
        self.block("} else {", regions[1], targets, b)
        self.write("}")

    def repeat(self, node: Expr, targets: list[str]) -> None:
        """As in `Printer`."""
        body, _, new, stop, limit = node.extra
        for target, start in zip(targets, node.args):
            self.write(f"real {target} = {self.bare(start)};")
        self.write(f"for (int k = 0; k < {limit}; k++) {{")
        self.depth += 1
        self.region(body)
        done = self.fresh("b")
        self.write(f"const int {done} = {self.bare(stop)};")
        for target, value in zip(targets, new):
            self.write(f"const real next_{target} = {self.bare(value)};")
        for target in targets:
            self.write(f"{target} = next_{target};")
        self.write(f"if ({done}) break;")
        self.depth -= 1
        self.write("}")

    def source(self) -> str:
        """Text of the function, with the same signature for every kernel.

        `void name(state, memory, inputs, par, tables, table_sizes, state_next, outputs)`: scalars in the order of
        `names`, array memory (changed in place) and tables apart; `state_next` may be `state`.
        """
        for name, cls, symbols in self.graph.arguments:
            self._unpack(name, cls, symbols)
        self.region(self.graph.tape.root)
        for target, (_, entries) in zip(("state_next", "outputs"), self.graph.results):
            self._pack(target, entries)
        signature = (
            f"void {self.graph.name}(const real *state, real *const *memory, const real *inputs, const real *par,\n"
            "    const real *const *tables, const int *table_sizes, real *state_next, real *outputs)\n{\n"
            "    (void)state; (void)memory; (void)inputs; (void)par; (void)tables; (void)table_sizes;\n"
            "    (void)state_next; (void)outputs;\n"
        )
        return signature + "\n".join(self.lines) + "\n}\n"

    def _unpack(self, name: str, cls: type, symbols: list[Expr]) -> None:
        scalars = arrays = 0
        is_array = {field: layout.kind in ARRAYS for field, layout in fields(cls).items()}
        for symbol, entry in zip(symbols, names(cls)):
            self.text[symbol.id] = text = f"{name}_{entry}"
            if is_array.get(entry, False):
                if symbol.id in self.uses:
                    self._unpack_array(text, symbol.extra, arrays)
                arrays += 1
            else:
                if symbol.id in self.uses:
                    self.write(f"const real {text} = {name}[{scalars}];")
                scalars += 1

    def _unpack_array(self, text: str, kind: str, index: int) -> None:
        if kind == "memory":
            self.write(f"real *const {text} = memory[{index}]; (void){text};")
        else:
            self.write(f"const real *const {text} = tables[{index}];")
            self.write(f"const int {text}_size = table_sizes[{index}]; (void){text}_size;")

    def _pack(self, target: str, entries: list[Any]) -> None:
        scalars = arrays = 0
        for entry in entries:
            if isinstance(entry, list):
                self.write(f"for (int k = 0; k < {len(entry)}; k++) memory[{arrays}][k] = R(0.0);")
                arrays += 1
            elif not (isinstance(entry, Expr) and (entry.op == "store" or entry.extra == "memory")):
                self.write(f"{target}[{scalars}] = {self.ref(entry)};")
                scalars += 1
