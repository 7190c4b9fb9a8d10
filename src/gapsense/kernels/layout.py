"""Layout of the records that kernels take and return: named tuples of scalars, vectors, covariances, memory and tables.

A field is annotated `Scalar`, or `Annotated[Array, Vector(3)]` and likewise `Covariance(n)`, `Memory(n)`, `Table()`, or
with the class of a record that it holds. `Annotated[Scalar, Law]` says that a parameter is one of the choices `Law`.
`flat` and `record` turn a record into the flat sequence that generated code works on and back; of a covariance it holds
the upper triangle.  The fields of a record within a record keep their names, which must differ from all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import EnumMeta, IntEnum
from functools import cache, partial
from itertools import islice
from typing import Any, NamedTuple, TypeAlias, TypeVar, get_type_hints

import numpy as np

Scalar: TypeAlias = Any  # float, or a traced scalar
Array: TypeAlias = Any  # object array of scalars, list, or traced memory


Span: TypeAlias = "tuple[int, int] | None"  # least and greatest value of a whole number; None: any number


class Field(NamedTuple):
    """How one field of a record is laid out; `size` is its dimension, or the length of its memory.

    `spans` say which numbers of a state are whole, because indices are made of them: a saved state with others is
    refused.  Those of a memory are of its first numbers, then again of the next ones, and so on.  `used` is a parameter
    that says how many numbers of a memory are used: the first, and all at its start value.
    """

    kind: str = "scalar"
    size: int = 1
    spans: tuple[Span, ...] = (None,)
    used: str = ""


COUNT = (0, 2**40)  # of samples or operations: more than any run has


def Whole(least: int, most: int) -> Field:
    """Layout of a scalar that is a whole number of this span."""
    return Field(spans=((least, most),))


Count = Whole(*COUNT)
Vector = partial(Field, "vector")  # (n,)
Covariance = partial(Field, "covariance")  # (n, n), symmetric
Memory = partial(Field, "memory")  # n values, zero at the start, that `load` and `store` reach by index
Table = partial(Field, "table")  # a parameter of any length
T = TypeVar("T")
ARRAYS = ("memory", "table")
NESTED = (tuple, list, np.ndarray)


class Choice(IntEnum):
    """Choices of a parameter, with the names of its port and their places there as values; or named states."""


def fields(cls: type) -> dict[str, Field]:
    """Name and layout of every field of a record class, in order; in place of a record, its fields."""
    return dict(_leaves(cls))


def parts(cls: type) -> dict[str, Any]:
    """Of every field the class of the record that it holds, or None."""
    return {name: at if _is_record(at) else None for name, at in _layout(cls).items()}


def choices(cls: type) -> dict[str, tuple[str, ...]]:
    """Names of the choices of every field that has them, also in nested records."""
    found: dict[str, tuple[str, ...]] = {}
    for name, note in _notes(cls).items():
        found |= choices(note) if _is_record(note) else {}
        found |= {name: tuple(note.__members__)} if isinstance(note, EnumMeta) else {}
    return found


@cache
def _notes(cls: Any) -> dict[str, Any]:
    """Of every field the note in its annotation, or the class of the record that it is."""
    hints = get_type_hints(cls, include_extras=True)
    return {name: next(iter(getattr(hints[name], "__metadata__", ())), hints[name]) for name in cls._fields}


@cache
def _layout(cls: Any) -> dict[str, Any]:
    """Of every field its layout, or the class of the record that it is."""
    return {
        name: note if _is_record(note) or isinstance(note, Field) else Field() for name, note in _notes(cls).items()
    }


def _is_record(note: Any) -> bool:
    return isinstance(note, type) and hasattr(note, "_fields")


@cache
def _leaves(cls: Any) -> list[tuple[str, Field]]:
    parts = [_leaves(at) if _is_record(at) else [(name, at)] for name, at in _layout(cls).items()]
    return [leaf for part in parts for leaf in part]


def names(cls: type) -> list[str]:
    """Names of the flat entries of a record class: `r`, `x_0`, `P_01`, ..."""
    entries = [entry for name, field in _leaves(cls) for entry in _entries(name, field)]
    if len(entries) != len(set(entries)):
        raise ValueError(
            f"`{cls.__name__}`: a field is called like another, or like an entry of a vector or covariance; rename it."
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


def leaves(value: Any) -> Iterator[tuple[str, Field, Any]]:
    """Name, layout and value of every field of a record; in place of a record, those of its fields."""
    cls: Any = type(value)
    for (name, at), item in zip(_layout(cls).items(), value):
        yield from leaves(item) if _is_record(at) else [(name, at, item)]


@cache
def _is_plain(cls: Any) -> bool:
    """Whether each field of a record is one entry."""
    return not any(_is_record(at) or at.kind in ("vector", "covariance") for at in _layout(cls).values())


def flat(value: Any) -> list[Any]:
    """Flat entries of a record."""
    cls: Any = type(value)
    if _is_plain(cls):
        return [*value]
    entries: list[Any] = []
    for flattened, item in zip(_flatteners(cls), value):
        entries += flattened(item)
    return entries


@cache
def _flatteners(cls: Any) -> list[Callable[[Any], Sequence[Any]]]:
    """Of every field what makes entries of it."""
    return [*map(_flattener, _layout(cls).values())]


def _flattener(at: Any) -> Callable[[Any], Sequence[Any]]:
    if _is_record(at):
        return flat
    if at.kind == "covariance":
        upper = np.triu_indices(at.size)
        return lambda P: P[upper].tolist()
    return list if at.kind == "vector" else lambda item: (item,)


def record(cls: Any, entries: Iterable[Any]) -> Any:
    """Record of class `cls` from its flat entries."""
    rest = iter(entries)
    if _is_plain(cls):
        return cls(*islice(rest, len(cls._fields)))
    return cls(*(taken(rest) for taken in _takers(cls)))


@cache
def _takers(cls: Any) -> list[Callable[[Iterator[Any]], Any]]:
    """Of every field what takes its entries from those that are left."""
    return [*map(_taker, _layout(cls).values())]


def _taker(at: Any) -> Callable[[Iterator[Any]], Any]:
    if _is_record(at):
        return partial(record, at)
    if at.kind == "covariance":
        places, count = _square(at.size), len(triangle(at.size))
        return lambda rest: _vector(count, rest)[places]
    return partial(_vector, at.size) if at.kind == "vector" else next


def _vector(size: int, rest: Iterator[Any]) -> Any:
    return np.array([*islice(rest, size)], dtype=object)


def _square(size: int) -> Any:
    """Of every place of a covariance that in its upper triangle (size, size)."""
    places = np.zeros((size, size), int)
    places[np.triu_indices(size)] = range(len(triangle(size)))
    return np.triu(places) + np.triu(places, 1).T


def zeros(size: int) -> list[float]:
    """Array memory of `size` zeros."""
    return [0.0] * size


def blank(cls: Callable[..., T], **given: Any) -> T:
    """A record of zeros but for what is given; its vectors, memories and records are of zeros too."""
    return cls(**{name: _zero(at) for name, at in _layout(cls).items() if name not in given}, **given)


def _zero(at: Any) -> Any:
    if _is_record(at):
        return blank(at)
    if at.kind in ("vector", "covariance"):
        return np.full((at.size,) * (1 + (at.kind == "covariance")), 0.0, dtype=object)
    return zeros(at.size) if at.kind == "memory" else 0.0


def flatten(value: Any) -> list[Any]:
    """Scalars of any nested structure of tuples, lists and arrays, in order."""
    if not isinstance(value, NESTED):
        return [value]
    found: list[Any] = []
    for item in value:
        found += flatten(item) if isinstance(item, NESTED) else [item]
    return found


def rebuild(like: T, scalars: Iterator[Any]) -> T:
    """The structure of `like` filled with `scalars`."""
    return _rebuild(like, scalars)  # type: ignore[no-any-return]


def _rebuild(like: Any, scalars: Iterator[Any]) -> Any:
    if isinstance(like, np.ndarray):
        return np.array([*(_rebuild(item, scalars) for item in like.ravel())], dtype=object).reshape(like.shape)
    if isinstance(like, (tuple, list)):
        items = [_rebuild(item, scalars) for item in like]
        return like._make(items) if hasattr(like, "_make") else type(like)(items)
    return next(scalars)
