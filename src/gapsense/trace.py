"""Trace a kernel written as plain numpy code into an expression graph.

A kernel runs on Python floats as it stands.  Run on `Expr` values (in numpy object arrays where it uses matrices) the same
lines record what they compute: matrix products unroll, structural zeros and ones vanish, common subexpressions are shared.
`emit.py` prints the graph as scalar Python, as numpy code over N runs, or as C99.  The order of operations is kept, so that
source, scalar Python and C give the same bits (up to the sign of a zero, and as long as no operand is infinite or NaN).

Rules for kernels: arithmetic, comparisons, `& | not_`, and the operations below; no `if` on data (`where`, `cond`, `loop`);
no `**` (`square`); guard denominators on both sides of `where`; array memory through `load` and `store`.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

BOOLEAN = ("<", "<=", ">", ">=", "==", "!=", "and", "or", "not")
UNARY = ("sqrt", "log", "exp", "fabs", "floor", "sin", "cos", "tanh")


class TraceError(TypeError):
    """A kernel does something that cannot be traced; the message names its line."""


class Region:
    """A straight piece of the graph: the body of a function, a branch or a loop."""

    def __init__(self, parent: Region | None = None) -> None:
        self.parent = parent
        self.nodes: list[Expr] = []
        self.known: dict[tuple[Any, ...], Expr] = {}
        self.owner = sys.maxsize  # number of the `if` node that holds this region: nothing later may be used in it


class Tape:
    """One tracing run: the open regions and the count of nodes."""

    def __init__(self) -> None:
        self.root = Region()
        self.region = self.root
        self.count = 0

    def node(self, op: str, args: tuple[Any, ...], extra: Any = None) -> Expr:
        """Append a node that is not shared."""
        node = Expr(self, op, args, extra)
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


def _operator(operation: Callable[[Any, Any], Any], swapped: bool = False) -> Callable[[Expr, Any], Any]:
    def method(self: Expr, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented  # numpy then works element by element
        return operation(other, self) if swapped else operation(self, other)

    return method


class Expr:
    """A traced scalar: an operation on other scalars."""

    __slots__ = ("args", "extra", "id", "op", "tape")

    def __init__(self, tape: Tape, op: str, args: tuple[Any, ...], extra: Any = None) -> None:
        self.tape, self.op, self.args, self.extra, self.id = tape, op, args, extra, tape.count
        tape.count += 1

    __hash__ = object.__hash__
    __add__ = __radd__ = _operator(lambda a, b: _add(a, b))
    __sub__, __rsub__ = _operator(lambda a, b: _sub(a, b)), _operator(lambda a, b: _sub(a, b), swapped=True)
    __mul__ = __rmul__ = _operator(lambda a, b: _mul(a, b))
    __truediv__, __rtruediv__ = _operator(lambda a, b: _div(a, b)), _operator(lambda a, b: _div(a, b), swapped=True)
    __lt__, __le__ = _operator(lambda a, b: _make("<", a, b)), _operator(lambda a, b: _make("<=", a, b))
    __gt__, __ge__ = _operator(lambda a, b: _make(">", a, b)), _operator(lambda a, b: _make(">=", a, b))
    __eq__ = _operator(lambda a, b: _make("==", a, b))  # type: ignore[assignment]
    __ne__ = _operator(lambda a, b: _make("!=", a, b))  # type: ignore[assignment]
    __and__ = __rand__ = _operator(lambda a, b: _logic("and", a, b))
    __or__ = __ror__ = _operator(lambda a, b: _logic("or", a, b))

    def __neg__(self) -> Expr:
        return _make("neg", self)

    def __pow__(self, exponent: Any) -> Any:
        raise TraceError(
            f"{_place()}: `**` is not traced, because C and Python round it differently. Use square(x) or x * x."
        )

    def __bool__(self) -> bool:
        raise TraceError(
            f"{_place()}: `if`, `and`, `or` or `not` on a traced value. Use where(), cond(), loop(), & or |."
        )

    def __float__(self) -> float:
        raise TraceError(f"{_place()}: a traced value is turned into a float. Use the operations of gapsense.trace.")


def _place() -> str:
    """File, line and function of the kernel: the nearest caller that is neither this file nor numpy."""
    frame = sys._getframe(2)
    while frame.f_back and (
        frame.f_code.co_filename == __file__ or "numpy" in frame.f_code.co_filename.split("site-packages")[-1]
    ):
        frame = frame.f_back
    return f"{frame.f_code.co_filename}:{frame.f_lineno}, in {frame.f_code.co_name}"


def _key(value: Any) -> Any:
    """What makes a scalar the same as another: its node, or its number with the sign of a zero."""
    return value.id if isinstance(value, Expr) else (float(value), math.copysign(1.0, value))


def is_traced(*values: Any) -> bool:
    """Whether any of the scalars is traced."""
    return any(isinstance(v, Expr) for v in values)


def _tape(*values: Any) -> Tape:
    return next(v.tape for v in values if isinstance(v, Expr))


def _make(op: str, *args: Any, extra: Any = None) -> Any:
    return _tape(*args).shared(op, tuple(a if isinstance(a, Expr) else float(a) for a in args), extra)


def _is(value: Any, number: float) -> bool:
    return not isinstance(value, Expr) and value == number


def _commute(op: str, a: Any, b: Any) -> Expr:
    return _make(op, b, a) if isinstance(a, Expr) and isinstance(b, Expr) and a.id > b.id else _make(op, a, b)


def _add(a: Any, b: Any) -> Any:
    return b if _is(a, 0.0) else a if _is(b, 0.0) else _commute("+", a, b)


def _sub(a: Any, b: Any) -> Any:
    return a if _is(b, 0.0) else _make("neg", b) if _is(a, 0.0) else _make("-", a, b)


def _mul(a: Any, b: Any) -> Any:
    for x, y in ((a, b), (b, a)):
        if _is(x, 0.0):
            return 0.0
        if _is(x, 1.0) or _is(x, -1.0):
            return y if x == 1.0 else _make("neg", y)
    return _commute("*", a, b)


def _div(a: Any, b: Any) -> Any:
    return 0.0 if _is(a, 0.0) else a if _is(b, 1.0) else _make("/", a, b)


def _logic(op: str, a: Any, b: Any) -> Any:
    for x, y in ((a, b), (b, a)):
        if not isinstance(x, Expr):
            return y if bool(x) is (op == "and") else bool(x)
    return _make(op, a, b)


def _unary(name: str) -> Callable[[Any], Any]:
    evaluate = getattr(math, name)

    def function(x: Any) -> Any:
        return _make(name, x) if isinstance(x, Expr) else float(evaluate(x))

    function.__name__, function.__doc__ = name, f"`{name}` of a scalar, traced or not."
    return function


sqrt, log, exp, fabs, floor, sin, cos, tanh = map(_unary, UNARY)


def square(x: Any) -> Any:
    """`x * x`."""
    return x * x


def not_(c: Any) -> Any:
    """Logical negation."""
    return _make("not", c) if isinstance(c, Expr) else not c


def where(c: Any, a: Any, b: Any) -> Any:
    """`a` if `c` else `b`; both are computed, so both must be harmless."""
    if a is b or not isinstance(c, Expr):
        return a if a is b or c else b
    return _make("where", c, a, b)


def clip(x: Any, low: Any, high: Any) -> Any:
    """`x` limited to [low, high]."""
    return where(x < low, low, where(x > high, high, x))


def load(array: Any, index: Any, shift: int = 0) -> Any:
    """Element `index + shift` of a table or of array memory; `index` is a whole number."""
    if isinstance(array, Expr):
        return _make("load", array, index, extra=shift)
    return array[int(index) + shift]


def store(array: Any, index: Any, value: Any) -> Any:
    """Array memory with element `index` set, in place.  Not inside `cond` or `loop`: send idle writes to a spare element."""
    if isinstance(array, Expr):
        if array.tape.region is not array.tape.root:
            raise TraceError(
                f"{_place()}: store() inside cond() or loop(). Store outside, with a spare index when idle."
            )
        return array.tape.node("store", (array, index, value))
    array[int(index)] = value
    return array


def zeros(size: int) -> list[float]:
    """Array memory of `size` zeros."""
    return [0.0] * size


def locate(table: Any, x: Any) -> Any:
    """Index `k` with `table[k] < x <= table[k + 1]`, from 0 to `len(table) - 2` (so that both ends extrapolate)."""
    if isinstance(table, Expr):
        return _make("locate", table, x)
    return min(max(bisect_left(table, x) - 1, 0), len(table) - 2)


def flatten(value: Any) -> list[Any]:
    """Scalars of a nested structure of tuples, lists and arrays, in order."""
    if isinstance(value, (tuple, list, np.ndarray)):
        return [scalar for item in value for scalar in flatten(item)]
    return [value]


def rebuild(like: Any, scalars: Iterator[Any]) -> Any:
    """The structure of `like` filled with `scalars`."""
    if isinstance(like, np.ndarray):
        return np.array([*(rebuild(item, scalars) for item in like.ravel())], dtype=object).reshape(like.shape)
    if isinstance(like, (tuple, list)):
        items = [rebuild(item, scalars) for item in like]
        return like._make(items) if hasattr(like, "_make") else type(like)(items)
    return next(scalars)


def cond(c: Any, then: Callable[[], Any], otherwise: Callable[[], Any]) -> Any:
    """`then()` if `c` else `otherwise()`, a real branch; both return the same structure of scalars."""
    if not isinstance(c, Expr):
        return then() if c else otherwise()
    tape, regions, branches = c.tape, [], []
    for function in (then, otherwise):
        regions.append(Region(tape.region))
        branches.append(tape.inside(regions[-1], function))
    outs = [flatten(b) for b in branches]
    if len(outs[0]) != len(outs[1]):
        raise TraceError(
            f"{_place()}: the branches of cond() return {len(outs[0])} and {len(outs[1])} values; they must match."
        )
    node = tape.node("if", (c,), (*regions, [], []))
    for region in regions:
        region.owner = node.id
    merged: dict[Any, Any] = {}

    def merge(a: Any, b: Any) -> Any:
        key = _key(a), _key(b)
        if key not in merged:
            node.extra[2].append(a)
            node.extra[3].append(b)
            merged[key] = a if key[0] == key[1] else tape.node("get", (node,), len(node.extra[2]) - 1)
        return merged[key]

    return rebuild(branches[0], map(merge, *outs))


def loop(limit: int, body: Callable[..., tuple[Any, Any]], state: Sequence[Any]) -> tuple[Any, ...]:
    """Repeat `state, stop = body(*state)` until `stop`, at most `limit` times; `state` is a flat sequence of scalars."""
    start = tuple(state)
    for _ in range(limit):
        if is_traced(*start):
            return _traced_loop(_tape(*start), limit, body, start)
        new, stop = body(*start)
        if is_traced(*new, stop):
            return _traced_loop(_tape(*new, stop), limit, body, start)
        start, limit = tuple(new), limit - 1
        if stop:
            break
    return start


def _traced_loop(
    tape: Tape, limit: int, body: Callable[..., tuple[Any, Any]], start: tuple[Any, ...]
) -> tuple[Any, ...]:
    region = Region(tape.region)

    def trace_body() -> Any:
        variables = tuple(tape.node("var", ()) for _ in start)
        return variables, *body(*variables)

    variables, new, stop = tape.inside(region, trace_body)
    node = tape.node(
        "loop",
        tuple(s if isinstance(s, Expr) else float(s) for s in start),
        (region, variables, tuple(new), stop, limit),
    )
    return tuple(tape.node("get", (node,), k) for k in range(len(start)))
