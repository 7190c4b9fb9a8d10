"""Forward derivatives on a traced graph: the derivative shares every subexpression with the function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from gapsense.trace import BOOLEAN, Expr, TraceError, cos, sin, where

_FLAT = (*BOOLEAN, "locate", "floor", "in", "load")  # derivative zero almost everywhere


def derivative(y: Any, x: Expr, memo: dict[tuple[int, int], Any] | None = None) -> Any:
    """dy/dx on the same graph (forward mode), for an input `x`; through `cond`, not through `loop`."""
    if y is x:
        return 1.0
    if not isinstance(y, Expr) or y.op in _FLAT:
        return 0.0
    memo = {} if memo is None else memo
    key = (id(x.tape.region), y.id)
    if key not in memo:
        memo[key] = _RULES[y.op](y, lambda a: derivative(a, x, memo))
    return memo[key]


def _through_cond(y: Expr, d: Callable[[Any], Any]) -> Any:
    holder = y.args[0]
    if holder.op != "if":
        raise TraceError(
            "a derivative through loop() is not supported. Unroll the loop or write the derivative by hand."
        )
    then, otherwise, *outs = holder.extra
    for region, out in zip((then, otherwise), outs):
        out.append(y.tape.inside(region, partial(d, out[y.extra])))
    return y.tape.node("get", (holder,), len(outs[0]) - 1)


_RULES: dict[str, Callable[[Expr, Callable[[Any], Any]], Any]] = {
    "get": _through_cond,
    "+": lambda y, d: d(y.args[0]) + d(y.args[1]),
    "-": lambda y, d: d(y.args[0]) - d(y.args[1]),
    "neg": lambda y, d: -d(y.args[0]),
    "*": lambda y, d: d(y.args[0]) * y.args[1] + y.args[0] * d(y.args[1]),
    "/": lambda y, d: (d(y.args[0]) - y * d(y.args[1])) / y.args[1],
    "where": lambda y, d: where(y.args[0], d(y.args[1]), d(y.args[2])),
    "fabs": lambda y, d: where(y.args[0] < 0.0, -d(y.args[0]), d(y.args[0])),
    "sqrt": lambda y, d: d(y.args[0]) / (2.0 * y),
    "log": lambda y, d: d(y.args[0]) / y.args[0],
    "exp": lambda y, d: d(y.args[0]) * y,
    "sin": lambda y, d: d(y.args[0]) * cos(y.args[0]),
    "cos": lambda y, d: -d(y.args[0]) * sin(y.args[0]),
    "tanh": lambda y, d: d(y.args[0]) * (1.0 - y * y),
}


def jacobian(functions: Sequence[Any], variables: Sequence[Expr]) -> Any:
    """Matrix of df/dx, an object array (len(functions), len(variables))."""
    memos: list[dict[tuple[int, int], Any]] = [{} for _ in variables]
    return np.array([[derivative(f, x, memo) for x, memo in zip(variables, memos)] for f in functions], dtype=object)
