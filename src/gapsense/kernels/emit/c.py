"""Print a traced graph as C99 without dependencies, in double or float."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import count
from typing import Any

from gapsense.kernels.elementary import DOUBLE, FLOAT, FORMULAS, Format
from gapsense.kernels.emit.cells import Cells
from gapsense.kernels.emit.printer import Graph, Loop, Printer, elementary
from gapsense.kernels.layout import fields, names
from gapsense.kernels.trace import ARITHMETIC, BOOLEAN, UNARY, Expr, Region, memory_of

WHOLE = (*BOOLEAN, "locate")  # operations that give whole numbers
NUMERIC = (*ARITHMETIC, *BOOLEAN[:6], "where")
LOCATE = """static inline int locate(const {real} *table, int size, {real} x)
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
LARGEST, LEAST = 3.4028234e38, 1.5e-45  # of float
# A number is a sign, an exponent with a bias, and a mantissa without its first digit.  A whole number stands in the
# last bits of its sum with 1.5 2^{digits}.
BITS = """static inline {word} bits_of({real} x) {{ {word} bits; memcpy(&bits, &x, sizeof x); return bits; }}
static inline {real} of_bits({word} bits) {{ {real} x; memcpy(&x, &bits, sizeof x); return x; }}
static inline {real} scaled({real} x, {real} n) {{ return x * of_bits(bits_of(n + {rounder}) << {digits}); }}
"""
OF_LOG = """\
static inline {real} exponent({real} x) {{ return of_bits((bits_of(x) >> {digits}) | bits_of({large})) - {start}; }}
static inline {real} mantissa({real} x) {{ return of_bits((bits_of(x) << {rest} >> {rest}) | bits_of({one})); }}
"""
FORMATS = {"double": (64, 52, 1023, DOUBLE), "float": (32, 23, 127, FLOAT)}  # bits, those of a mantissa, bias
INCLUDES = "#include <math.h>\n#include <stdint.h>\n#include <string.h>\n"
AS_WRITTEN = """#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
"""
# Array memory is reached through these: no number, whoever restored it, reads or writes anything else.
WHOLE_NUMBER = """static inline int whole({real} x) { return x >= 0 && x < 1000000000 ? (int)x : -1; }
"""
WITHIN = """static inline int within(int k, int size) { return k >= 0 && k < size ? k : 0; }
"""


SIGNATURE = """void {name}(real *restrict state, real *const *memory, const real *restrict inputs,
    const real *restrict {par}, const real *const *tables, const int *table_sizes, real *restrict outputs)
{{
    (void)state; (void)memory; (void)inputs; (void){par}; (void)tables; (void)table_sizes; (void)outputs;
"""


FEW = 24  # numbers of a state for which registers are a better place than itself


class C(Printer):
    """C99 without dependencies; `-DSINGLE` builds it in float."""

    end = ";"
    real = "real"  # what the type of a number is called
    truth = "int"  # and that of a truth value
    whole_operations: tuple[str, ...] = WHOLE
    forms = Printer.forms | {
        "unary": "F({op})({b[0]})",
        "scaled": "scaled({b[0]}, {b[1]})",
        **{name: f"{name}({{b[0]}})" for name in ("exponent", "mantissa")},
        **{name: f"same_{name}({{b[0]}})" for name in FORMULAS},
        "not": "(!{a[0]})",
        "and": "({a[0]} && {a[1]})",
        "or": "({a[0]} || {a[1]})",
        "where": "({a[0]} ? {a[1]} : {a[2]})",
        "locate": "locate({a[0]}, {a[0]}_size, {b[1]})",
        "whole": "whole({0})",
    }
    head = (
        "/* Build with -ffp-contract=off and without -ffast-math to get the bits of the Python code. */\n"
        + INCLUDES
        + AS_WRITTEN
        + """#ifdef SINGLE
typedef float real;
#define R(x) x##f
#define F(name) name##f
#else
typedef double real;
#define R(x) x
#define F(name) name
#endif

"""
        + (LOCATE + WHOLE_NUMBER + WITHIN).replace("{real}", "real")
    )

    @classmethod
    def module(cls, *functions: str) -> str:
        """Text of a file with some functions, and before them those of `elementary` that they call."""
        single, double = (same(real, functions) for real in ("float", "double"))
        own = [f"#ifdef SINGLE\n{single}#else\n{double}#endif\n"] if double else []
        return "\n".join([cls.head, *own, *functions])

    def __init__(self, graph: Graph, tables: Sequence[str] = ()) -> None:
        super().__init__(graph)
        self.whole: set[int] = set()  # variables of loops that are whole numbers
        self.cells: dict[tuple[int, int], Expr] = {}  # of what an `if` node gives, where in the state it stands
        self.cell_texts: set[str] = set()
        entries = [(cls, entry, s) for _, cls, symbols in graph.arguments for entry, s in zip(names(cls), symbols)]
        self.tables = tables or [entry for _, entry, s in entries if s.extra == "table"]  # by place
        self.memory_sizes = {s.id: self.memory_size(cls, entry) for cls, entry, s in entries if s.extra == "memory"}

    def memory_size(self, cls: type, entry: str) -> int:
        """Numbers of an array memory."""
        return fields(cls)[entry].size

    def _number(self, value: Any) -> str:
        if isinstance(value, bool):
            return str(int(value))
        if math.isfinite(value):
            return f"R({value!r})"
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0.0 else "(-INFINITY)"

    def _let(self, node: Expr, text: str) -> str:
        name = self.fresh()
        self.write(f"const {self.truth if self.is_index(node) else self.type_of(node)} {name} = {text};")
        return name

    def operand(self, node: Expr, value: Any) -> str:
        """Text of an operand; a place in a table becomes a number where one is computed with it."""
        is_place = isinstance(value, Expr) and value.op == "locate" and value.op in self.whole_operations
        is_number = node.op in NUMERIC and not all(map(self.is_whole, node.args[-2:]))
        return f"({self.real}){self.ref(value)}" if is_place and is_number else self.ref(value)

    def element(self, node: Expr) -> str:
        """Text of the element that a `load` or `store` means; of array memory one that there is."""
        text, memory = super().element(node), memory_of(node.args[0])
        if memory is None or not isinstance(node.args[1], Expr):
            return text
        return f"within({text}, {self.memory_sizes[memory.id]})"

    def type_of(self, value: Any) -> str:
        """Type of a value: truth values and places in tables are whole numbers, also where they are chosen from."""
        return self.truth if self.is_whole(value) else self.real

    def is_whole(self, value: Any) -> bool:
        """Whether a value is a truth value or a place in a table."""
        if not isinstance(value, Expr):
            return isinstance(value, bool)
        if value.op == "where":
            return all(map(self.is_whole, value.args[1:]))
        if value.op == "get":
            holder = value.args[0]
            chosen = [*holder.extra[2].values()][value.extra] if holder.op == "if" else [holder.args[value.extra]]
            return all(map(self.is_whole, chosen))
        return value.op in self.whole_operations or value.id in self.whole

    def _branch(self, c: Any, regions: tuple[Region, Region], targets: list[str], a: list[Any], b: list[Any]) -> None:
        for kind, whole in (("int", True), (self.real, False)):
            new = [at for at in zip(targets, a, b) if at[0] not in self.cell_texts]
            found = [t for t, x, y in new if (self.is_whole(x) and self.is_whole(y)) is whole]
            if found:
                self.write(f"{kind} {', '.join(found)};")
        self.block(f"if ({self.bare(c)}) {{", regions[0], targets, a)
        self.block("} else {", regions[1], targets, b)
        if self.lines[-1].endswith("} else {"):
            self.lines.pop()
        self.write("}")

    def _start(self, loop: Loop) -> None:
        for target, start, variable in zip(loop.targets, loop.starts, loop.variables):
            self.whole |= {variable.id} if self.is_whole(start) else set()
            self.write(f"{self.type_of(start)} {target} = {self.bare(start)};")

    def _repeat(self, loop: Loop) -> None:
        self._start(loop)
        round_ = self.fresh("k")
        self.write(f"for (int {round_} = 0; {round_} < {loop.limit}; {round_}++) {{")
        self.depth += 1
        self.region(loop.body)
        done = self.fresh("b")
        self.write(f"const int {done} = {self.bare(loop.stop)};")
        for target, value in zip(loop.targets, loop.new):
            self.write(f"const {self.type_of(value)} next_{target} = {self.bare(value)};")
        for target in loop.targets:
            self.write(f"{target} = next_{target};")
        self.write(f"if ({done}) break;")
        self.depth -= 1
        self.write("}")

    def source(self) -> str:
        """Text of the function, with the same signature for every kernel.

        `void name(state, memory, inputs, par, tables, table_sizes, outputs)`: scalars in the order of `names`, array
        memory and tables apart.  State and memory are changed in place.  A single record that is made is `outputs`;
        what follows from the parameters alone takes the place of `par` where it is given.
        """
        for name, cls, symbols in self.graph.arguments:
            self._unpack(name, cls, symbols)
        self.use_state()
        self.region(self.graph.tape.root)
        *states, (_, outputs) = self.graph.results
        self._pack("outputs", outputs)
        for _, entries in states:
            self._pack("state", entries)
        par = next((name for name, _, _ in self.graph.arguments if name == "constants"), "par")
        return SIGNATURE.format(name=self.graph.name, par=par) + "\n".join(self.lines) + "\n}\n"

    def use_state(self) -> None:
        """Let values stand in the state, if the function changes one."""
        state = self.state()
        if len(state) > FEW and len(self.graph.results) > 1:
            self.cells = Cells(self).find_cells(state, self.graph.results[0][1], self.is_whole)
            self.cell_texts = {self.text[symbol.id] for symbol in state}

    def state(self) -> list[Expr]:
        """The symbols of the state that the function takes."""
        return [symbol for name, _, symbols in self.graph.arguments if name == "state" for symbol in symbols]

    def holder(self, node: Expr, k: int) -> str:
        """Name of a value that an `if` node gives: a number of the state where it can stand there."""
        cell = self.cells.get((node.id, k))
        return super().holder(node, k) if cell is None else self.text[cell.id]

    def _unpack(self, name: str, cls: type, symbols: list[Expr]) -> None:
        scalars, memories = count(), count()
        for symbol, entry in zip(symbols, names(cls)):
            text = f"{name}_{entry}"
            if symbol.extra == "memory":
                line = f"real *const {text} = memory[{next(memories)}]; (void){text};"
            elif symbol.extra == "table":
                k = self.tables.index(entry)
                line = f"const real *const {text} = tables[{k}]; (void){text};"
                line += f" const int {text}_size = table_sizes[{k}]; (void){text}_size;"
            else:
                line, text = "", f"{'(int)' if self.is_whole(symbol) else ''}{name}[{next(scalars)}]"
            self.text[symbol.id] = text
            if line and symbol.id in self.uses:
                self.write(line)

    def _pack(self, target: str, entries: list[Any]) -> None:
        arrays = count()
        for entry in entries:
            if isinstance(entry, list):
                self.write(f"for (int k = 0; k < {len(entry)}; k++) memory[{next(arrays)}][k] = R(0.0);")
        numbers = [entry for entry in entries if not isinstance(entry, list) and held(entry) is None]
        self.put([f"{target}[{k}]" for k in range(len(numbers))], numbers)

    def put(self, targets: list[str], values: list[Any]) -> None:
        """Print `target = value` for each; values that stand in cells may be exchanged."""
        texts = [self.bare(value) for value in values]
        for k, (target, text) in enumerate(zip(targets, texts)):
            if target != text and text in targets:
                texts[k] = self.fresh()
                self.write(f"const {self.real} {texts[k]} = {text};")
        for target, text in zip(targets, texts):
            if text != target:
                self.write(f"{target} = {text};")


def held(entry: Any) -> Expr | None:
    """The argument that a result is: array memory, which changes in place, or a table."""
    is_table = isinstance(entry, Expr) and entry.op == "in" and entry.extra == "table"
    return entry if is_table else memory_of(entry)


class Typed(C):
    """C in float or double, without macros."""

    def __init__(self, graph: Graph, real: str) -> None:
        super().__init__(graph)
        self.real = real

    def form(self, op: str) -> str:
        """What an operation looks like; those of the library end in `f` for float."""
        ending = "f" if self.real == "float" else ""
        return f"{op}{ending}({{b[0]}})" if op in UNARY and op not in self.forms else super().form(op)

    def _number(self, value: Any) -> str:
        """Text of a constant in the type; what is too large or too small for it is infinite or zero."""
        return str(int(value)) if isinstance(value, bool) else number(value, self.real)


def number(value: float, real: str) -> str:
    """A constant of type `real`."""
    if real == "float":
        size = abs(value)
        value = math.copysign(math.inf, value) if size > LARGEST else 0.0 if size < LEAST else value
    if math.isfinite(value):
        return f"{float(value)!r}{'f' if real == 'float' else ''}"
    text = f"({real})NAN" if math.isnan(value) else "HUGE_VALF" if real == "float" else "HUGE_VAL"
    return f"(-{text})" if value < 0.0 else text


def same(real: str, functions: Iterable[str]) -> str:
    """C of those functions of `elementary` that some functions call, in float or double."""
    called = [name for name in FORMULAS if any(f"same_{name}(" in text for text in functions)]
    size, digits, bias, form = FORMATS[real]
    powers = {"one": 1.0, "large": 2.0**digits, "start": 2.0**digits + bias, "rounder": form.rounder + bias}
    numbers = {name: number(power, real) for name, power in powers.items()}
    texts = ["\n".join(_definition(name, real, form)) for name in called]
    helpers = BITS + (OF_LOG if "log" in called else "")
    bits = helpers.format(real=real, word=f"uint{size}_t", digits=digits, rest=size - digits, **numbers)
    return "\n".join([bits, *texts, ""]) if called else ""


def _definition(name: str, real: str, form: Format) -> list[str]:
    body = Typed(elementary(name, form), real).definition()
    return [f"static inline {real} same_{name}({real} x)", "{", *body, "}", ""]
