"""Layout of records."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

from gapsense.kernels.layout import (
    Array,
    Choice,
    Covariance,
    Memory,
    Scalar,
    Table,
    Vector,
    blank,
    choices,
    fields,
    flat,
    flatten,
    leaves,
    names,
    rebuild,
    record,
    triangle,
)


class Mixed(NamedTuple):
    r: Scalar
    x: Annotated[Array, Vector(2)]
    P: Annotated[Array, Covariance(2)]
    log: Annotated[Array, Memory(4)]
    table: Annotated[Array, Table()]


class Empty(NamedTuple):
    pass


class Clashing(NamedTuple):
    x_0: Scalar
    x: Annotated[Array, Vector(2)]


class Law(Choice):
    linear, table = range(2)


class Inner(NamedTuple):
    y: Annotated[Array, Vector(2)]
    law: Annotated[Scalar, Law]


class Middle(NamedTuple):
    inner: Inner
    last: Scalar


class Outer(NamedTuple):
    r: Scalar
    middle: Middle
    log: Annotated[Array, Memory(4)]


class Twice(NamedTuple):
    inner: Inner
    law: Scalar


def test_names_and_layout() -> None:
    assert names(Mixed) == ["r", "x_0", "x_1", "P_00", "P_01", "P_11", "log", "table"]
    assert [f.kind for f in fields(Mixed).values()] == ["scalar", "vector", "covariance", "memory", "table"]
    assert fields(Mixed)["log"].size == 4
    assert triangle(3) == [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]


def test_flat_and_record_are_inverse() -> None:
    entries = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, [0.0] * 4, [1.0, 2.0]]
    value = record(Mixed, entries)
    assert flat(value) == entries
    assert value.P[1, 0] == value.P[0, 1] == 5.0
    assert isinstance(value.x[0], float) and not isinstance(value.x[0], np.floating)


def test_empty_record() -> None:
    assert names(Empty) == [] and flat(Empty()) == [] and record(Empty, []) == Empty()


def test_clashing_names_are_refused() -> None:
    with pytest.raises(ValueError, match="rename"):
        names(Clashing)


def test_records_within_records_are_laid_out_depth_first_under_their_own_names() -> None:
    assert names(Outer) == ["r", "y_0", "y_1", "law", "last", "log"]
    assert [*fields(Outer)] == ["r", "y", "law", "last", "log"] and fields(Outer)["log"].kind == "memory"
    entries = [1.0, 2.0, 3.0, 4.0, 5.0, [0.0] * 4]
    value = record(Outer, entries)
    assert value.middle.inner.y[1] == 3.0 and value.middle.last == 5.0
    assert flat(value) == entries
    assert [name for name, _, _ in leaves(value)] == [*fields(Outer)]


def test_a_name_that_two_records_use_is_refused() -> None:
    with pytest.raises(ValueError, match=r"`Twice`: .*rename"):
        names(Twice)


def test_choices_are_numbered_by_their_place() -> None:
    assert choices(Inner) == choices(Outer) == {"law": ("linear", "table")}
    assert Law.table == 1.0 and fields(Inner)["law"].kind == "scalar"


def test_nested_structures_are_flattened_and_rebuilt() -> None:
    value: Any = (1.0, [2.0, np.array([[3.0, 4.0]], dtype=object)], Clashing(5.0, 6.0))
    assert flatten(value) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    again = rebuild(value, iter([x * 10.0 for x in flatten(value)]))
    assert again[1][1].tolist() == [[30.0, 40.0]] and again[2] == Clashing(50.0, 60.0)


class Plain(NamedTuple):
    inner: Inner
    P: Annotated[Array, Covariance(2)]
    log: Annotated[Array, Memory(3)]
    last: Scalar


def test_a_blank_record_is_of_zeros_but_for_what_is_given() -> None:
    found = blank(Plain, last=2.0)
    assert names(Plain) == ["y_0", "y_1", "law", "P_00", "P_01", "P_11", "log", "last"]
    assert flat(found) == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, [0.0, 0.0, 0.0], 2.0]
    with pytest.raises(TypeError, match="other"):
        blank(Plain, other=1.0)
