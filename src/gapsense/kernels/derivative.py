"""Forward derivatives on a traced graph: the derivative shares every subexpression with the function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from gapsense.kernels.emit import Graph, compile_graph
from gapsense.kernels.emit.printer import operands
from gapsense.kernels.layout import fields, flatten
from gapsense.kernels.trace import BOOLEAN, Expr, Tape, TraceError, is_traced, select, where

_FLAT = (*BOOLEAN, "locate", "floor", "in", "load")  # derivative zero almost everywhere


def derivative(
    y: Any, x: Expr, memo: dict[tuple[int, int], Any] | None = None, held: frozenset[int] = frozenset()
) -> Any:
    """Derivative dy/dx on the same graph, in forward mode, 0.0 for none; through `cond`, not through `loop`.

    `memo` has the derivatives by the same `x` found earlier, `held` the `Expr.id` of values that count as constants.
    """
    if not isinstance(x, Expr):
        raise TraceError(f"a derivative by the constant {x!r}. Use a traced value; a loop() must also start from one.")
    if y is x:
        return 1.0
    if not isinstance(y, Expr) or y.id < x.id or y.id in held:  # what was computed before x cannot depend on it
        return 0.0
    memo = {} if memo is None else memo
    key = (id(x.tape.region), y.id)  # in a branch, a derivative may use what is only known there
    if key not in memo:
        memo[key] = _rule(y, x)(y, lambda a: derivative(a, x, memo, held))
    return memo[key]


def jacobian(functions: Sequence[Any], variables: Sequence[Expr], constants: Iterable[Any] = ()) -> Any:
    """Matrix of partial derivatives df/dx, an object array (len(functions), len(variables)).

    The other variables and the `constants` count as constants, also if they were computed from each other; each
    variable must be a node of its own.
    """
    if len({id(x) for x in variables}) < len(variables):
        raise TraceError(
            "two variables of jacobian() are the same traced value: their derivatives cannot be told apart."
        )
    held = frozenset(x.id for x in (*variables, *constants) if isinstance(x, Expr))
    memos: list[dict[tuple[int, int], Any]] = [{} for _ in variables]
    rows = [[derivative(f, x, memo, held) for x, memo in zip(variables, memos)] for f in functions]
    return np.array(rows, dtype=object)


def linearise(function: Callable[..., Any], x: Any, *records: Any) -> tuple[Any, Any]:
    """Value (m,) of `function(x, *records)` and its Jacobian by the vector `x`, an object array (m, n).

    The records count as constants, also where they were computed from `x`.
    The same bits on floats as traced: for floats, `function` is traced and compiled once; it must be one of a module,
    and `records` named tuples of scalars and tables.  A constant among traced values of `x` is told apart as a sum.
    """
    traced = [v for v in (*x, *(value for record in records for value in record)) if is_traced(v)]
    if traced:
        tape = traced[0].tape
        x = np.array([v if is_traced(v) else tape.node("+", (v, 0.0)) for v in x], dtype=object)
        values = function(x, *records)
        return np.array([*values], dtype=object), jacobian(values, x, (v for record in records for v in record))
    flat = _compile_linearised(function, len(x), *map(type, records))((*x, *(v for record in records for v in record)))
    m = len(flat) // (len(x) + 1)
    return np.array(flat[:m], dtype=object), np.array(flat[m:], dtype=object).reshape(m, len(x))


@cache
def _compile_linearised(function: Callable[..., Any], n: int, *classes: Any) -> Any:
    tape = Tape()
    x = np.array([tape.node("in", ()) for _ in range(n)], dtype=object)
    records = [cls(*(tape.node("in", (), field.kind) for field in fields(cls).values())) for cls in classes]
    values, J = linearise(function, x, *records)
    symbols = flatten([x, records])
    layout = NamedTuple("layout", [(f"a{k}", Any) for k in range(len(symbols))])  # type: ignore[misc]
    graph = Graph("linearised", tape, [("at", layout, symbols)], [(tuple, [*values, *J.ravel()])])
    return compile_graph(graph)


_Rule = Callable[[Expr, Callable[[Any], Any]], Any]


def _rule(y: Expr, x: Expr) -> _Rule:
    if y.op == "var":
        is_constant = x.op == "var" and y.extra is x.extra  # another variable of the same loop
    elif (y.op == "get" and y.args[0].op == "loop") or (y.op == "load" and y.args[0].op == "store"):
        is_constant = not _depends(y, x)
    else:
        return _RULES[y.op]
    if is_constant:
        return _zero
    what = "array memory" if y.op == "load" else "loop()"
    raise TraceError(f"a derivative through {what} is not supported. Unroll it or write the derivative by hand.")


def _zero(y: Expr, d: Callable[[Any], Any]) -> float:
    return 0.0


def _depends(y: Expr, x: Expr) -> bool:
    pending, seen = [y], {y.id}
    while pending:
        node = pending.pop()
        if node is x:
            return True
        for value, _ in operands(node, node.tape.root):
            if isinstance(value, Expr) and value.id >= x.id and value.id not in seen:
                seen.add(value.id)
                pending.append(value)
    return False


def _through_branches(y: Expr, d: Callable[[Any], Any]) -> Any:
    holder = y.args[0]
    then, otherwise, outs = holder.extra
    pair = [*outs.values()][y.extra]
    return select(holder, *(y.tape.inside(region, partial(d, out)) for region, out in zip((then, otherwise), pair)))


_RULES: dict[str, _Rule] = {
    **dict.fromkeys(_FLAT, _zero),
    "get": _through_branches,
    "+": lambda y, d: d(y.args[0]) + d(y.args[1]),
    "-": lambda y, d: d(y.args[0]) - d(y.args[1]),
    "neg": lambda y, d: -d(y.args[0]),
    "*": lambda y, d: d(y.args[0]) * y.args[1] + y.args[0] * d(y.args[1]),
    "/": lambda y, d: (d(y.args[0]) - y * d(y.args[1])) / y.args[1],
    "where": lambda y, d: where(y.args[0], d(y.args[1]), d(y.args[2])),
    "fabs": lambda y, d: where(y.args[0] < 0.0, 0.0 - d(y.args[0]), d(y.args[0])),
    "sqrt": lambda y, d: d(y.args[0]) / (2.0 * y),
    "log": lambda y, d: d(y.args[0]) / y.args[0],
    "exp": lambda y, d: d(y.args[0]) * y,
    "tanh": lambda y, d: d(y.args[0]) * (1.0 - y * y),
}
