"""Layout of the records that kernels take and return: named tuples of scalars, vectors, covariances, memory and tables.

A field is annotated `Scalar`, or `Annotated[Array, Vector(3)]` and likewise `Covariance(n)`, `Memory(n)`, `Table()`.
`flat` and `record` turn a record into the flat sequence that generated code works on and back; of a covariance it holds
the upper triangle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, partial
from typing import Any, NamedTuple, TypeAlias, get_type_hints

import numpy as np

Scalar: TypeAlias = Any  # float, or a traced scalar
Array: TypeAlias = Any  # object array of scalars, list, or traced memory


class Field(NamedTuple):
    """How one field of a record is laid out; `size` is its dimension, or the length of its memory."""

    kind: str = "scalar"
    size: int = 1


Vector = partial(Field, "vector")  # (n,)
Covariance = partial(Field, "covariance")  # (n, n), symmetric
Memory = partial(Field, "memory")  # n values, zero at the start, that `load` and `store` reach by index
Table = partial(Field, "table")  # a parameter of any length
ARRAYS = ("memory", "table")


def fields(cls: type) -> dict[str, Field]:
    """Name and layout of every field of a record class, in order."""
    return _fields(cls)


@cache
def _fields(cls: Any) -> dict[str, Field]:
    hints = get_type_hints(cls, include_extras=True)
    return {name: next(iter(getattr(hints[name], "__metadata__", ())), Field()) for name in cls._fields}


def names(cls: type) -> list[str]:
    """Names of the flat entries of a record class: `r`, `x_0`, `P_01`, ..."""
    entries = [entry for name, field in fields(cls).items() for entry in _entries(name, field)]
    if len(entries) != len(set(entries)):
        raise ValueError(
            f"`{cls.__name__}`: a scalar field is called like an entry of a vector or covariance; rename it."
        )
    return entries


def _entries(name: str, field: Field) -> list[str]:
    if field.kind == "vector":
        return [f"{name}_{i}" for i in range(field.size)]
    if field.kind == "covariance":
        return [f"{name}_{i}{j}" for i, j in triangle(field.size)]
    return [name]


def triangle(n: int) -> list[tuple[int, int]]:
    """Indices of the upper triangle, row by row."""
    return [(i, j) for i in range(n) for j in range(i, n)]


def flat(value: Any) -> list[Any]:
    """Flat entries of a record."""
    entries: list[Any] = []
    for (_, field), item in zip(fields(type(value)).items(), value):
        if field.kind == "vector":
            entries += list(item)
        elif field.kind == "covariance":
            entries += [item[i, j] for i, j in triangle(field.size)]
        else:
            entries.append(item)
    return entries


def record(cls: type, entries: Sequence[Any]) -> Any:
    """Record of class `cls` from its flat entries."""
    rest = iter(entries)
    return cls(*(_take(field, rest) for field in fields(cls).values()))


def _take(field: Field, rest: Iterator[Any]) -> Any:
    if field.kind == "vector":
        return np.array([next(rest) for _ in range(field.size)], dtype=object)
    if field.kind == "covariance":
        P = np.empty((field.size, field.size), dtype=object)
        for i, j in triangle(field.size):
            P[i, j] = P[j, i] = next(rest)
        return P
    return next(rest)


def zeros(size: int) -> list[float]:
    """Array memory of `size` zeros."""
    return [0.0] * size


def flatten(value: Any) -> list[Any]:
    """Scalars of any nested structure of tuples, lists and arrays, in order."""
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
