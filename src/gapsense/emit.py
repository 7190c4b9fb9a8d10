"""Print a traced graph as scalar Python (stdlib only), as numpy code over N runs, or as C99 in double or float."""

from __future__ import annotations

from typing import Any, NamedTuple

from gapsense.records import ARRAYS, fields, names
from gapsense.trace import BOOLEAN, UNARY, Expr, Region, Tape

LONGEST_INLINE = 90  # characters; a longer expression gets a name even if it is used once


class Graph(NamedTuple):
    """A traced function: its arguments (name, record class, symbols) and the flat entries of each record it returns."""

    name: str
    tape: Tape
    arguments: list[tuple[str, type, list[Expr]]]
    results: list[tuple[type, list[Any]]]


def _children(node: Expr) -> list[Any]:
    """Operands of a node, those hidden in its branches or its loop body included."""
    if node.op == "if":
        return [*node.args, *node.extra[2], *node.extra[3]]
    return [*node.args, *node.extra[2], node.extra[3]] if node.op == "loop" else [*node.args]


def _regions(node: Expr) -> tuple[Region, ...]:
    return node.extra[:2] if node.op == "if" else node.extra[:1] if node.op == "loop" else ()


def _shift(node: Expr) -> str:
    return f" + {node.extra}" if node.extra else ""


class Printer:
    """Walks the live nodes in order; subclasses say how the statements and expressions of one language look."""

    indent_unit = "    "
    words = {"and": "and", "or": "or"}

    def __init__(self, graph: Graph) -> None:
        self.graph, self.lines, self.depth, self.count = graph, [], 1, 0
        self.text: dict[int, str] = {}
        self.holders: dict[int, list[str]] = {}
        self.uses: dict[int, int] = {}
        self.home: dict[int, Region] = {}
        self.far: set[int] = set()  # used in another region than their own: never inlined
        for _, entries in graph.results:
            for entry in entries:
                self._use(entry, 2)
        self._place(graph.tape.root)

    def _use(self, root: Any, weight: int) -> None:
        pending = [(root, weight)]
        while pending:
            node, weight = pending.pop()
            if isinstance(node, Expr):
                first = node.id not in self.uses
                self.uses[node.id] = self.uses.get(node.id, 0) + weight
                if first:
                    pending += [(child, 2 if node.op in ("if", "loop") else 1) for child in _children(node)]

    def _place(self, region: Region) -> None:
        for node in region.nodes:
            self.home[node.id] = region
            for inner in _regions(node):
                self._place(inner)
            for child in node.args:
                if isinstance(child, Expr) and self.home.get(child.id) is not region:
                    self.far.add(child.id)

    def write(self, line: str) -> None:
        self.lines.append(self.indent_unit * self.depth + line)

    def fresh(self, letter: str = "t") -> str:
        self.count += 1
        return f"{letter}{self.count}"

    def ref(self, value: Any) -> str:
        return self.text[value.id] if isinstance(value, Expr) else self.number(float(value))

    def region(self, region: Region) -> None:
        """Print the live nodes of a region."""
        for node in region.nodes:
            if node.id not in self.uses or node.id in self.text:
                continue
            if node.op == "if":
                self.holders[node.id] = [self.fresh("c") for _ in node.extra[2]]
                self.branch(node, self.holders[node.id])
            elif node.op == "loop":
                self.holders[node.id] = [self.fresh("v") for _ in node.args]
                self.repeat(node, self.holders[node.id])
            elif node.op == "get":
                self.text[node.id] = self.holders[node.args[0].id][node.extra]
            elif node.op == "store":
                self.text[node.id] = self.store(*map(self.ref, node.args))
            else:
                self._expression(node)

    def _expression(self, node: Expr) -> None:
        text = self.expression(node)
        inline = (
            self.uses[node.id] == 1 and node.id not in self.far and len(text) < LONGEST_INLINE and node.op != "load"
        )
        self.text[node.id] = text if inline else self.let(node, text)

    def expression(self, node: Expr) -> str:
        a = [self.ref(arg) for arg in node.args]
        if node.op in UNARY:
            return self.call(node.op, a[0])
        if node.op == "neg":
            return f"(-{a[0]})"
        if node.op in ("load", "locate", "where", "not"):
            return str(getattr(self, node.op if node.op != "not" else "negate")(node, *a))
        return f"({a[0]} {self.words.get(node.op, node.op)} {a[1]})"

    def assign(self, targets: list[str], values: list[Any]) -> None:
        for target, value in zip(targets, values):
            self.write(f"{target} = {self.ref(value)}{self.end}")

    def block(self, opening: str, region: Region, targets: list[str], values: list[Any]) -> None:
        self.write(opening)
        self.depth += 1
        self.region(region)
        self.assign(targets, values)
        self.depth -= 1

    end = ""

    def number(self, value: float) -> str:
        return repr(value)

    def let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(f"{name} = {text}")
        return name


class Python(Printer):
    """Scalar Python that needs the standard library only."""

    head = (
        "from bisect import bisect_left\nfrom math import cos, exp, floor, log, sin, sqrt, tanh\n\n\n"
        "def locate(table, x):\n    return min(max(bisect_left(table, x) - 1, 0), len(table) - 2)\n"
    )
    extra_argument = ""

    def call(self, name: str, x: str) -> str:
        return f"abs({x})" if name == "fabs" else f"float(floor({x}))" if name == "floor" else f"{name}({x})"

    def where(self, node: Expr, c: str, a: str, b: str) -> str:
        return f"({a} if {c} else {b})"

    def negate(self, node: Expr, a: str) -> str:
        return f"(not {a})"

    def locate(self, node: Expr, table: str, x: str) -> str:
        return f"locate({table}, {x})"

    def load(self, node: Expr, array: str, index: str) -> str:
        return f"{array}[int({index}){_shift(node)}]"

    def store(self, array: str, index: str, value: str) -> str:
        self.write(f"{array}[int({index})] = {value}")
        return array

    def branch(self, node: Expr, targets: list[str]) -> None:
        then, otherwise, a, b = node.extra
        self.block(f"if {self.ref(node.args[0])}:", then, targets, a)
        self.block("else:", otherwise, targets, b)

    def repeat(self, node: Expr, targets: list[str]) -> None:
        body, variables, new, stop, limit = node.extra
        self.text.update((v.id, t) for v, t in zip(variables, targets))
        self.assign(targets, list(node.args))
        self.write(f"for _ in range({limit}):")
        self.depth += 1
        self.region(body)
        done = self.fresh("b")
        self.write(f"{done} = {self.ref(stop)}")
        self.advance(targets, new, done)
        self.depth -= 1

    def advance(self, targets: list[str], new: tuple[Any, ...], done: str) -> None:
        self.write(f"{', '.join(targets)} = {', '.join(map(self.ref, new))}")
        self.write(f"if {done}:")
        self.write("    break")

    def memory(self, size: int) -> str:
        return f"[0.0] * {size}"

    def source(self) -> str:
        """The function's text; it takes and returns flat tuples."""
        g = self.graph
        for name, cls, symbols in g.arguments:
            self.text.update((s.id, f"{name}_{entry}") for s, entry in zip(symbols, names(cls)))
            unpacked = [self.text[s.id] if s.id in self.uses else "_" for s in symbols]
            if symbols:
                self.write(f"{', '.join(unpacked)}{',' * (len(symbols) == 1)} = {name}")
        self.region(g.tape.root)
        groups = [
            "("
            + "".join(f"{self.memory(len(e)) if isinstance(e, list) else self.ref(e)}, " for e in entries).rstrip()
            + ")"
            for _, entries in g.results
        ]
        self.write(f"return {', '.join(groups)}")
        arguments = ", ".join(name for name, _, _ in g.arguments)
        return f"def {g.name}({arguments}{self.extra_argument}):\n" + "\n".join(self.lines) + "\n"


class Numpy(Python):
    """Numpy code over N runs at once: scalars become arrays (N,), array memory becomes (size, N)."""

    head = (
        "from numpy import any as any_, arange, asarray, clip, cos, exp, fabs, floor, log, logical_not, searchsorted, sin, sqrt,"
        " tanh, where, zeros\n\n\ndef whole(x):\n    return asarray(x).astype(int)\n\n\n"
        "def locate(table, x):\n    return clip(searchsorted(table, x) - 1, 0, len(table) - 2)\n"
    )
    extra_argument = ", runs"
    words = {"and": "&", "or": "|"}

    def call(self, name: str, x: str) -> str:
        return f"{name}({x})"

    def where(self, node: Expr, c: str, a: str, b: str) -> str:
        return f"where({c}, {a}, {b})"

    def negate(self, node: Expr, a: str) -> str:
        return f"logical_not({a})"

    def load(self, node: Expr, array: str, index: str) -> str:
        lane = ", arange(runs)" if node.args[0].extra != "table" else ""
        return f"{array}[whole({index}){_shift(node)}{lane}]"

    def store(self, array: str, index: str, value: str) -> str:
        self.write(f"{array}[whole({index}), arange(runs)] = {value}")
        return array

    def branch(self, node: Expr, targets: list[str]) -> None:
        then, otherwise, a, b = node.extra
        self.region(otherwise)
        self.assign(targets, b)
        condition = self.ref(node.args[0])
        self.write(f"if any_({condition}):")
        self.depth += 1
        self.region(then)
        for target, value in zip(targets, a):
            self.write(f"{target} = where({condition}, {self.ref(value)}, {target})")
        self.depth -= 1

    def repeat(self, node: Expr, targets: list[str]) -> None:
        self.write(f"busy{targets[0]} = True")
        super().repeat(node, targets)

    def advance(self, targets: list[str], new: tuple[Any, ...], done: str) -> None:
        busy = f"busy{targets[0]}"
        updated = ", ".join(f"where({busy}, {self.ref(n)}, {t})" for n, t in zip(new, targets))
        self.write(f"{', '.join(targets)} = {updated}")
        self.write(f"{busy} = {busy} & logical_not({done})")
        self.write(f"if not any_({busy}):")
        self.write("    break")

    def memory(self, size: int) -> str:
        return f"zeros(({size}, runs))"


class C(Printer):
    """C99 without dependencies; `-DSINGLE` builds it in float."""

    end = ";"
    words = {"and": "&&", "or": "||"}
    head = """#include <math.h>
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

    def number(self, value: float) -> str:
        return f"R({value!r})"

    def let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(f"const {'int' if node.op in (*BOOLEAN, 'locate') else 'real'} {name} = {text};")
        return name

    def call(self, name: str, x: str) -> str:
        return f"F({name})({x})"

    def where(self, node: Expr, c: str, a: str, b: str) -> str:
        return f"({c} ? {a} : {b})"

    def negate(self, node: Expr, a: str) -> str:
        return f"(!{a})"

    def locate(self, node: Expr, table: str, x: str) -> str:
        return f"locate({table}, {table}_size, {x})"

    def load(self, node: Expr, array: str, index: str) -> str:
        return f"{array}[(int){index}{_shift(node)}]"

    def store(self, array: str, index: str, value: str) -> str:
        self.write(f"{array}[(int){index}] = {value};")
        return array

    def branch(self, node: Expr, targets: list[str]) -> None:
        then, otherwise, a, b = node.extra
        if targets:
            self.write(f"real {', '.join(targets)};")
        self.block(f"if ({self.ref(node.args[0])}) {{", then, targets, a)
        self.block("} else {", otherwise, targets, b)
        self.write("}")

    def repeat(self, node: Expr, targets: list[str]) -> None:
        body, variables, new, stop, limit = node.extra
        self.text.update((v.id, t) for v, t in zip(variables, targets))
        for target, start in zip(targets, node.args):
            self.write(f"real {target} = {self.ref(start)};")
        self.write(f"for (int k = 0; k < {limit}; k++) {{")
        self.depth += 1
        self.region(body)
        done = self.fresh("b")
        self.write(f"const int {done} = {self.ref(stop)};")
        for target, value in zip(targets, new):
            self.write(f"const real next_{target} = {self.ref(value)};")
        for target in targets:
            self.write(f"{target} = next_{target};")
        self.write(f"if ({done}) break;")
        self.depth -= 1
        self.write("}")

    def source(self) -> str:
        """`void name(state, memory, inputs, par, tables, table_sizes, state_next, outputs)`, the same for every kernel."""
        for name, cls, symbols in self.graph.arguments:
            self._unpack(name, cls, symbols)
        self.region(self.graph.tape.root)
        for target, (_, entries) in zip(("state_next", "outputs"), self.graph.results):
            self._pack(target, entries)
        signature = (
            f"void {self.graph.name}(const real *state, real *const *memory, const real *inputs, const real *par,\n"
            "    const real *const *tables, const int *table_sizes, real *state_next, real *outputs)\n{\n"
            "    (void)state; (void)memory; (void)inputs; (void)par; (void)tables; (void)table_sizes;\n"
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
            self.write(f"real *const {text} = memory[{index}];")
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
