"""Print a traced graph as C99 without dependencies, in double or float."""

from __future__ import annotations

import math
from itertools import count
from typing import Any

from gapsense.emit.printer import Printer
from gapsense.records import ARRAYS, names
from gapsense.trace import BOOLEAN, Expr, Region, memory_of


class C(Printer):
    """C99 without dependencies; `-DSINGLE` builds it in float."""

    end = ";"
    forms = Printer.forms | {
        "unary": "F({op})({b[0]})",
        "not": "(!{a[0]})",
        "and": "({a[0]} && {a[1]})",
        "or": "({a[0]} || {a[1]})",
        "where": "({a[0]} ? {a[1]} : {a[2]})",
        "locate": "locate({a[0]}, {a[0]}_size, {b[1]})",
        "whole": "(int)({0})",
    }
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

    def _number(self, value: Any) -> str:
        if isinstance(value, bool):
            return str(int(value))
        if math.isfinite(value):
            return f"R({value!r})"
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0.0 else "(-INFINITY)"

    def _let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(
            f"const {'int' if node.op in (*BOOLEAN, 'locate') or self.is_index(node) else 'real'} {name} = {text};"
        )
        return name

    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        if targets:
            self.write(f"real {', '.join(targets)};")
        self.block(f"if ({self.bare(c)}) {{", regions[0], targets, a)
        self.block("} else {", regions[1], targets, b)
        self.write("}")

    def _repeat(self, node: Expr, targets: list[str]) -> None:
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
        scalars, arrays = count(), count()
        for symbol, entry in zip(symbols, names(cls)):
            self.text[symbol.id] = text = f"{name}_{entry}"
            k = next(arrays if symbol.extra in ARRAYS else scalars)
            if symbol.id not in self.uses:
                continue
            if symbol.extra == "memory":
                self.write(f"real *const {text} = memory[{k}]; (void){text};")
            elif symbol.extra == "table":
                self.write(f"const real *const {text} = tables[{k}];")
                self.write(f"const int {text}_size = table_sizes[{k}]; (void){text}_size;")
            else:
                self.write(f"const real {text} = {name}[{k}];")

    def _pack(self, target: str, entries: list[Any]) -> None:
        scalars, arrays = count(), count()
        for entry in entries:
            if isinstance(entry, list):
                self.write(f"for (int k = 0; k < {len(entry)}; k++) memory[{next(arrays)}][k] = R(0.0);")
            elif memory_of(entry) is None:
                self.write(f"{target}[{next(scalars)}] = {self.ref(entry)};")
