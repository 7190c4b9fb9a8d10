"""Trace a kernel written as plain numpy code into an expression graph.

A kernel runs on Python floats as it stands.  Run on `Expr` values (in numpy object arrays where it uses matrices) the
same lines record what they compute: matrix products unroll, structural zeros and ones vanish, common subexpressions are
shared.  `emit` prints the graph as scalar Python, C over many runs, or C99.  The order of operations is kept:
source, scalar Python and C give the same bits, but for the sign of a zero and for operands that are not finite.

Rules for kernels: arithmetic, comparisons, `& | not_`, the operations below, and those of `elementary`; no `if` on data
(`where`, `cond`, `loop`); no `**` (`square`); guard denominators on both sides of `where`; array memory through `load`
and `store`.

An `Expr` is a node: operation and operands.  A `Region` lists the nodes of a function, branch or loop body; they may
use those of enclosing regions.  `cond` and `loop` nodes hold regions and what these return; `get` picks one value.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_left
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gapsense.kernels.layout import NESTED, T, flatten, rebuild

S = TypeVar("S", bound=Sequence[Any])
BOOLEAN = ("<", "<=", ">", ">=", "==", "!=", "and", "or", "not")
UNARY = ("sqrt", "fabs", "floor", "exponent", "mantissa", "exp", "log", "tanh")
ARITHMETIC = ("+", "-", "*", "/", "neg")
_PASSED_OVER = (__file__, str(Path(np.__file__).parent))  # files that an error does not point at
_HELPERS = (*_PASSED_OVER, str(Path(__file__).with_name("linalg.py")), str(Path(__file__).with_name("derivative.py")))


class TraceError(TypeError):
    """A kernel does something that cannot be traced; the message names its line."""


class Region:
    """A straight piece of the graph: the body of a function, a branch or a loop."""

    def __init__(self, parent: Region | None = None) -> None:
        self.parent = parent
        self.nodes: list[Expr] = []
        self.known: dict[tuple[Any, ...], Expr] = {}
        self.owner = sys.maxsize  # number of the `if` node that holds this region: nothing later may be used in it
        self.starts: dict[int, Any] | None = None  # of a loop body: what each variable is at first


class Place(NamedTuple):
    """A line of a kernel."""

    file: str
    function: str
    line: int


class Tape:
    """One tracing run: the open region, the count of nodes and, on request, the line that each node comes from."""

    def __init__(self, places: dict[int, Place] | None = None) -> None:
        self.root = self.region = Region()
        self.count = 0
        self.overwritten: set[int] = set()  # array memory as it was before a `store`
        self.places = places

    def node(self, op: str, args: tuple[Any, ...], extra: Any = None) -> Expr:
        """Append a node that is not shared."""
        node = Expr(self, op, args, extra)
        if self.places is not None:
            self.places[node.id] = _place(_HELPERS)
        self.region.nodes.append(node)
        return node

    def shared(self, op: str, args: tuple[Any, ...], extra: Any = None) -> Expr:
        """The node that computes this, from here or an enclosing region, else a new one."""
        key = (op, extra, *map(_key, args))
        region: Region | None = self.region
        limit = sys.maxsize
        while region is not None:
            found = region.known.get(key)
            if found is not None and found.id < limit:
                return found
            limit, region = min(limit, region.owner), region.parent
        node = self.region.known[key] = self.node(op, args, extra)
        return node

    def inside(self, region: Region, function: Callable[[], Any]) -> Any:
        """Result of `function()` with its nodes recorded in `region`."""
        outer, self.region = self.region, region
        try:
            return function()
        finally:
            self.region = outer


def _operator(op: str, swapped: bool = False) -> Callable[[Any, Any], Any]:
    def method(self: Any, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented  # numpy then works element by element
        return _binary(op, other, self) if swapped else _binary(op, self, other)

    return method


class Expr:
    """A traced scalar (or array memory): an operation on other scalars."""

    __slots__ = ("args", "extra", "id", "op", "tape")

    def __init__(self, tape: Tape, op: str, args: tuple[Any, ...], extra: Any = None) -> None:
        self.tape, self.op, self.args, self.extra, self.id = tape, op, args, extra, tape.count
        tape.count += 1

    __hash__ = object.__hash__
    __add__ = __radd__ = _operator("+")
    __sub__, __rsub__ = _operator("-"), _operator("-", swapped=True)
    __mul__ = __rmul__ = _operator("*")
    __truediv__, __rtruediv__ = _operator("/"), _operator("/", swapped=True)
    __lt__, __le__, __gt__, __ge__ = map(_operator, BOOLEAN[:4])
    __eq__, __ne__ = map(_operator, BOOLEAN[4:6])
    __and__ = __rand__ = _operator("and")
    __or__ = __ror__ = _operator("or")
    __neg__ = lambda self: _make("neg", self)  # noqa: E731
    __abs__ = lambda self: _make("fabs", self)  # noqa: E731

    def __pow__(self, exponent: Any) -> Any:
        raise _error("`**` is not traced, because C and Python round it differently. Use square(x) or x * x.")

    def __bool__(self) -> bool:
        raise _error("`if`, `and`, `or` or `not` on a traced value. Use where(), cond(), loop(), & or |.")

    def __float__(self) -> Any:
        raise _error(
            "a traced value is turned into a number or an index. Use the operations of gapsense.kernels.trace."
        )

    __rpow__, __int__, __index__ = __pow__, __float__, __float__


def _error(message: str) -> TraceError:
    """The error, with the place in the kernel: the nearest caller that is neither this file nor numpy."""
    file, function, line = _place(_PASSED_OVER)
    return TraceError(f"{file}:{line}, in {function}: {message}")


def _place(passed_over: tuple[str, ...]) -> Place:
    """Of the nearest caller that is in none of these files or folders."""
    frame = sys._getframe(1)
    while frame.f_back and frame.f_code.co_filename.startswith(passed_over):
        frame = frame.f_back
    return Place(frame.f_code.co_filename, frame.f_code.co_name, frame.f_lineno)


def _key(value: Any) -> Any:
    """What makes a scalar the same as another: its node, or its number with type and sign of a zero."""
    return value.id if isinstance(value, Expr) else (type(value) is bool, float(value), math.copysign(1.0, value))


def _scalar(value: Any) -> Any:
    """An operand: a node, a truth value or a float."""
    if isinstance(value, Expr):
        if value.id not in value.tape.overwritten:
            return value
        raise _error("array memory is used after a store(). Use what store() returned.")
    try:
        return bool(value) if isinstance(value, (bool, np.bool_)) else float(value)
    except (TypeError, ValueError):
        raise _error(f"a scalar is needed here, not `{type(value).__name__}`.") from None


def is_traced(*values: Any) -> bool:
    """Whether any of the scalars is traced."""
    return Expr in map(type, values)


def has_traced(value: Any) -> bool:
    """Whether any scalar of a nested structure is traced; array memory, of many thousand numbers, is walked in C."""
    kinds = {*map(type, value)}
    is_nested = any(issubclass(kind, NESTED) for kind in kinds)
    return Expr in kinds or (is_nested and any(has_traced(item) for item in value if isinstance(item, NESTED)))


def _tape(*values: Any) -> Tape:
    return next(v.tape for v in values if isinstance(v, Expr))


def _make(op: str, *args: Any, extra: Any = None) -> Any:
    if op in ARITHMETIC and any(isinstance(a, Expr) and a.op in BOOLEAN for a in args):
        raise _error("arithmetic on a truth value. Use where(c, 1.0, 0.0).")
    return _tape(*args).shared(op, tuple(map(_scalar, args)), extra)


def _is(value: Any, number: float) -> bool:
    return not isinstance(value, Expr) and value == number


def _binary(op: str, a: Any, b: Any) -> Any:
    """`a op b`, without what a zero or a one makes superfluous; the operands of a sum or product in a fixed order."""
    if op in ("and", "or"):
        return _logic(op, a, b)
    if (op == "+" and _is(a, 0.0)) or (op == "*" and _is(a, 1.0)):
        return b
    if (op in ("+", "-") and _is(b, 0.0)) or (op in ("*", "/") and _is(b, 1.0)):
        return a
    if (op in ("*", "/") and _is(a, 0.0)) or (op == "*" and _is(b, 0.0)):
        return 0.0
    if op == "*" and _is(b, -1.0):
        a, b = b, a
    if (op == "-" and _is(a, 0.0)) or (op == "*" and _is(a, -1.0)):
        return _make("neg", b)
    if op in ("+", "*") and is_traced(a) and is_traced(b) and a.id > b.id:
        a, b = b, a
    return _make(op, a, b)


def _logic(op: str, a: Any, b: Any) -> Any:
    constant, other = (b, a) if isinstance(a, Expr) else (a, b)
    if isinstance(constant, Expr):
        return _make(op, a, b)
    return other if bool(constant) is (op == "and") else bool(constant)


def operation(name: str, on_float: Callable[[float], Any]) -> Callable[[Any], Any]:
    """An operation of `UNARY`: a node if its operand is traced."""

    def function(x: Any) -> Any:
        return _make(name, x) if isinstance(x, Expr) else float(on_float(x))

    function.__name__, function.__doc__ = name, f"`{name}` of a scalar, traced or not."
    return function


sqrt, fabs, floor = (operation(name, getattr(math, name)) for name in ("sqrt", "fabs", "floor"))
# Of a positive normal number 2^k m, 1 <= m < 2: k and m.
exponent = operation("exponent", lambda x: math.frexp(x)[1] - 1)
mantissa = operation("mantissa", lambda x: 2.0 * math.frexp(x)[0])


def scale(x: Any, n: Any) -> Any:
    """`x * 2^n` for a whole `n` of which 2^n is a normal number."""
    return _make("scaled", x, n) if is_traced(x, n) else math.ldexp(x, int(n))


def square(x: Any) -> Any:
    """`x * x`."""
    return x * x


def not_(c: Any) -> Any:
    """Logical negation."""
    return _make("not", c) if isinstance(c, Expr) else not c


def where(c: Any, a: Any, b: Any) -> Any:
    """`a` if `c` else `b`; either may be computed in vain, so both must be harmless."""
    same = isinstance(c, Expr) and _key(_scalar(a)) == _key(_scalar(b))
    return _make("where", c, a, b) if isinstance(c, Expr) and not same else a if same or c else b


def where_each(c: Any, a: T, b: T) -> T:
    """`where` for each scalar of two records, or vectors, of one structure."""
    return rebuild(a, iter([where(c, x, y) for x, y in zip(flatten(a), flatten(b))]))


def flag(c: Any) -> Any:
    """A truth value as a record keeps it: 1 or 0."""
    return where(c, 1.0, 0.0)


def is_set(value: Any) -> Any:
    """The truth value of a flag or an option in a record."""
    return value > 0.0


def clip(x: Any, low: Any, high: Any) -> Any:
    """`x` limited to [low, high]."""
    return where(x < low, low, where(x > high, high, x))


def load(array: Any, index: Any, shift: int = 0) -> Any:
    """Element `index + shift` of a table or of array memory; `index` is a whole number, and inside."""
    if not isinstance(array, Expr):
        return array[int(index) + shift]
    return _make("load", array, index, extra=shift)


def store(array: Any, index: Any, value: Any, shift: int = 0) -> Any:
    """Array memory with an element set in place; from `cond` and `loop` it must be returned, as it came in."""
    if not isinstance(array, Expr):
        array[int(index) + shift] = value
        return array
    region: Region | None = array.tape.region
    while region is not None and region.starts is None:
        region = region.parent
    if region is not None and region is not _last_loop(array):
        raise _error("store() inside loop() to memory from outside. Let it be part of the loop's state.")
    node = array.tape.node("store", tuple(map(_scalar, (array, index, value))), shift)
    array.tape.overwritten.add(array.id)
    return node


def memory_of(value: Any) -> Expr | None:
    """The array memory that a value is, as it came in; None for a scalar."""
    while isinstance(value, Expr) and value.op in ("store", "get", "var"):
        value = value.extra.starts[value.id] if value.op == "var" else _before(value)
    return value if isinstance(value, Expr) and value.op == "in" and value.extra == "memory" else None


def _before(value: Expr) -> Any:
    """Array memory before a `store`, a branch or a loop."""
    holder = value.args[0]
    if value.op == "store":
        return holder
    return holder.args[value.extra] if holder.op == "loop" else [*holder.extra[2].values()][value.extra][0]


def _last_loop(array: Any) -> Any:
    """The body of the loop into which array memory came last, or None."""
    while isinstance(array, Expr) and array.op in ("store", "get"):
        array = _before(array)
    return array.extra if isinstance(array, Expr) and array.op == "var" else None


def locate(table: Any, x: Any) -> Any:
    """Index `k` with `table[k] < x <= table[k + 1]`, from 0 to `len(table) - 2` (so that both ends extrapolate)."""
    if isinstance(table, Expr):
        return _make("locate", table, x)
    return min(max(bisect_left(table, x) - 1, 0), len(table) - 2)


def cond(c: Any, then: Callable[[], T], otherwise: Callable[[], T]) -> T:
    """`then()` if `c` else `otherwise()`, a real branch; both return the same structure of scalars."""
    if not isinstance(c, Expr):
        return then() if c else otherwise()
    tape = c.tape
    regions = Region(tape.region), Region(tape.region)
    results: list[T] = []
    values: list[list[Any]] = []
    before, after = tape.overwritten, tape.overwritten
    for region, branch in zip(regions, (then, otherwise)):
        tape.overwritten = {*before}
        results.append(tape.inside(region, branch))
        values.append([_scalar(value) for value in flatten(results[-1])])
        after = after | tape.overwritten
    tape.overwritten, (a, b) = after, values
    if len(a) != len(b):
        raise _error(f"the branches of cond() return {len(a)} and {len(b)} values; they must match.")
    node = tape.node("if", (c,), (*regions, {}))
    regions[0].owner = regions[1].owner = node.id
    return rebuild(results[0], iter([select(node, x, y) for x, y in zip(a, b)]))


def when(c: Any, change: Callable[[T], T], value: T) -> T:
    """`change(value)` if `c` else `value`, a real branch."""
    return cond(c, lambda: change(value), lambda: value)


def select(node: Expr, a: Any, b: Any) -> Any:
    """Value that the `if` node takes from its branches: `a` from the first, `b` from the second."""
    key = _key(a), _key(b)
    if key[0] == key[1]:
        return a
    if a is True and b is False and node.args[0].op in BOOLEAN:
        return node.args[0]
    if memory_of(a) is not memory_of(b):
        raise _error("the branches of cond() return different array memory in the same place.")
    node.extra[2].setdefault(key, (a, b))
    return node.tape.shared("get", (node,), [*node.extra[2]].index(key))


def loop(limit: int, body: Callable[..., tuple[S, Any]], state: S) -> S:
    """Repeat `state, stop = body(*state)` until `stop`, `limit` times at most; a state has scalars, memory, records."""
    is_known = has_traced(state)
    for done in range(limit):
        new, stop = (state, False) if is_known else body(*state)
        if is_known or has_traced((new, stop)):
            return _trace_loop(_tape(*flatten((state, new, stop))), limit - done, body, state)
        state = new
        if stop:
            break
    return state


def _trace_loop(tape: Tape, limit: int, body: Callable[..., tuple[S, Any]], start: S) -> S:
    region, values = Region(tape.region), tuple(map(_scalar, flatten(start)))
    variables = tape.inside(region, lambda: tuple(tape.node("var", (), region) for _ in values))
    region.starts = {variable.id: value for variable, value in zip(variables, values)}
    tape.overwritten |= {value.id for value in values if memory_of(value) is not None}
    new, stop = tape.inside(region, lambda: body(*rebuild(start, iter(variables))))
    ends = tuple(map(_scalar, flatten(new)))
    if len(ends) != len(values):
        raise _error(f"the body of loop() returns {len(ends)} values for a state of {len(values)}; they must match.")
    if any(memory_of(a) is not memory_of(b) for a, b in zip(ends, values)):
        raise _error("the body of loop() returns array memory in another place than it came in.")
    node = tape.node("loop", values, (region, variables, ends, _scalar(stop), limit))
    return rebuild(start, iter([tape.node("get", (node,), k) for k in range(len(values))]))
