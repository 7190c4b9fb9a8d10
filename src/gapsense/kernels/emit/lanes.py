"""Print a traced graph as C over a few runs at once: on vectors of doubles, each of which rounds as it does alone.

`gapsense/kernels/lanes/lanes.h` has the types and what the operations are called.  Truth values are masks.  A branch is
computed for all runs of a vector if any of them takes it.  Numbers of the graph are not in the text but in `constants`:
models that differ in nothing else share one compiled function.
"""

from __future__ import annotations

from functools import cache
from itertools import count
from typing import Any

from gapsense.kernels.elementary import FORMULAS
from gapsense.kernels.emit.c import C, held
from gapsense.kernels.emit.printer import Graph, Loop, Printer, elementary
from gapsense.kernels.layout import ARRAYS, names
from gapsense.kernels.trace import BOOLEAN, Expr, Region

# Numbers that are about the formula, not about the model.
LITERALS = {text: text for text in ("0.0", "0.5", "1.0", "2.0", "-1.0")} | {
    "nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY",
}  # fmt: skip


class Lanes(C):
    """C over the runs of a vector, for gcc and clang."""

    real = "V"
    truth = "M"
    whole_operations = BOOLEAN
    forms = C.forms | {
        "unary": "each_{op}({b[0]})",
        "not": "(~{a[0]})",
        "and": "({a[0]} & {a[1]})",
        "or": "({a[0]} | {a[1]})",
        "where": "choose({b[0]}, {b[1]}, {b[2]})",
        "locate": "located({a[0]}, {b[1]}, block)",
        "whole": "whole({0})",
        "table": "element({a[0]}, {i}, block)",
        "load": "element({a[0]}, {i}, block)",
        "store": "put({a[0]}, {i}, {b[2]}, taken, block)",
    }
    condition_uses = 2

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.constants: dict[str, float] = {}  # by their text, in order

    def _number(self, value: Any) -> str:
        if isinstance(value, bool):
            return "ALL" if value else "NONE"
        if repr(value) in LITERALS:
            return f"every({LITERALS[repr(value)]})"
        self.constants.setdefault(repr(value), value)
        return f"every(k[{[*self.constants].index(repr(value))}])"

    def expression(self, node: Expr) -> str:
        """Text of an operation; truth values are chosen bit by bit as numbers are, but are of another type."""
        if node.op == "where" and self.is_whole(node):
            c, a, b = (self.ref(arg) for arg in node.args)
            return f"(({c} & {a}) | (~{c} & {b}))"
        text = super().expression(node)
        return f"numbers({text})" if node.op == "locate" and not self.is_index(node) else text

    element = Printer.element  # the header keeps them inside

    def _index(self, value: Any) -> str:
        is_whole = isinstance(value, Expr) and self.is_index(value)
        return self.bare(value) if is_whole else self.forms["whole"].format(self.bare(value))

    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        """Each branch knows the runs that take it by the name `taken`, as the function and loops know theirs."""
        types = [self.truth if self.is_whole(x) and self.is_whole(y) else self.real for x, y in zip(a, b)]
        for target, kind in zip(targets, types):
            self.write(f"{kind} {target} = {{0}};")
        condition, yes, no = self.ref(c), self.fresh("m"), self.fresh("m")
        self.write(f"const M {yes} = taken & {condition}, {no} = taken & ~{condition};")
        self._open(f"if (any({no})) {{", no)
        self.region(regions[1])
        self.assign(targets, b)
        self._close()
        self._open(f"if (any({yes})) {{", yes)
        self.region(regions[0])
        for target, kind, value in zip(targets, types, map(self.bare, a)):
            self.write(f"{target} = {self._choose(kind, condition, value, target)};")
        self._close()

    def _open(self, line: str, taken: str) -> None:
        self.write(line)
        self.depth += 1
        self.write(f"const M taken = {taken}; (void)taken;")

    def _close(self) -> None:
        self.depth -= 1
        self.write("}")

    def _choose(self, kind: str, condition: str, a: str, b: str) -> str:
        return f"choose{'_truth' * (kind == self.truth)}({condition}, {a}, {b})"

    def _repeat(self, loop: Loop) -> None:
        """Runs that have stopped keep what they have."""
        self._start(loop)
        busy, round_ = self.fresh("m"), self.fresh("k")
        self.write(f"M {busy} = taken;")
        self._open(f"for (int {round_} = 0; {round_} < {loop.limit} && any({busy}); {round_}++) {{", busy)
        self.region(loop.body)
        self.write(f"{busy} &= ~{self.ref(loop.stop)};")
        for target, start, value in zip(loop.targets, loop.starts, loop.new):
            chosen = self._choose(self.type_of(start), "taken", self.bare(value), target)
            self.write(f"const {self.type_of(start)} next_{target} = {chosen};")
        for target in loop.targets:
            self.write(f"{target} = next_{target};")
        self._close()

    def source(self) -> str:
        """Text of the function `void name(v, at, k, block)`, with its constants as `k`.

        `at` has the place of each entry of each argument, in `v` for a number, among the columns of `block` for array
        memory and tables; then the places of the numbers that are made.  A truth value is 1.0 or 0.0 outside.
        """
        places = count()
        for name, cls, symbols in self.graph.arguments:
            for symbol, entry, place in zip(symbols, names(cls), places):
                self._take(symbol, f"{name}_{entry}", place)
        self.region(self.graph.tape.root)
        for entry in (entry for _, entries in self.graph.results for entry in entries if not is_array(entry)):
            self._give(entry, next(places))
        signature = f"static void {self.graph.name}(V *v, const int *at, const double *k, const Block *block)\n{{\n"
        return (
            f"{signature}    const M taken = ALL; (void)taken; (void)k; (void)block;\n"
            + "\n".join(self.lines)
            + "\n}\n"
        )

    def _take(self, symbol: Expr, text: str, place: int) -> None:
        self.text[symbol.id] = text
        if symbol.id in self.uses and symbol.extra in ARRAYS:
            self.write(f"const Column *const {text} = &block->columns[at[{place}]];")
        elif symbol.id in self.uses:
            value = f"v[at[{place}]]"
            self.write(f"const {f'M {text} = {value} != 0.0' if self.is_whole(symbol) else f'V {text} = {value}'};")

    def _give(self, entry: Any, place: int) -> None:
        if self.is_whole(entry):
            self.write(f"v[at[{place}]] = choose({self.ref(entry)}, every(1.0), every(0.0));")
        else:
            self.write(f"v[at[{place}]] = {self.bare(entry)};")


class Common(Lanes):
    """C of what is the same whatever the model: its numbers are in the text."""

    def _number(self, value: Any) -> str:
        return super()._number(value) if isinstance(value, bool) else f"every({LITERALS.get(repr(value), repr(value))})"


def same_over_runs(text: str) -> list[str]:
    """Those functions of `elementary` that a function calls."""
    return [_same(name) for name in FORMULAS if f"same_{name}(" in text]


@cache
def _same(name: str) -> str:
    body = Common(elementary(name)).definition()
    return "\n".join([f"CALLED V same_{name}(V x)", "{", "    const M taken = ALL;", *body, "}", ""])


def is_array(entry: Any) -> bool:
    """Whether a result is no number: array memory that begins, or an argument that stays where it is."""
    return isinstance(entry, list) or held(entry) is not None
