"""Generated Python with few names: the same results, fewer variables."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.kernels.emit.python import rename_values

NESTED = """
    a, b, _ = given
    t1 = a + b
    t2 = t1 * 2.0
    if t1 > 0.0:
        t3 = t2 - a
        c4 = t2
        c5 = t3
    else:
        c4 = t2 if a > 1.0 else 0.0
        c5 = -1.0
    v6, v7 = c4, 0.0
    for _ in range(4):
        t8 = v6 + c5
        if t8 > t1:
            c9 = t8
        else:
            c9 = v7
        b10 = t8 > 9.0
        v6, v7 = t8, c9
        if b10:
            break
    t11 = v6 + t2
    return (v7, t11, b)
""".strip("\n").split("\n")  # fmt: skip


def called(lines: list[str], given_: Any) -> Any:
    space: dict[str, Any] = {}
    exec("def f(given):\n" + "\n".join(lines), space)
    return space["f"](given_)


@given(st.tuples(*[st.floats(-20.0, 20.0)] * 3))
def test_branches_and_loops_compute_the_same(values: tuple[float, float, float]) -> None:
    assert called(rename_values(NESTED), values) == called(NESTED, values)


def test_names_are_used_again_and_copies_vanish() -> None:
    text = "\n".join(rename_values(NESTED))
    assert "t8" not in text and "c4" not in text and "given" in text and "_ = given" in text
    straight = ["    t1 = a + 1.0", "    t2 = t1 + 1.0", "    t3 = t2", "    t4 = t3 + 1.0", "    return t4"]
    assert rename_values(straight) == ["    t1 = a + 1.0", "    t1 = t1 + 1.0", "    t1 = t1 + 1.0", "    return t1"]


def test_block_of_copies_only_stays_a_block() -> None:
    lines = ["    t1 = a", "    if a > 0.0:", "        c2 = t1", "    else:", "        c2 = -t1", "    return c2"]
    assert rename_values(lines)[1:4] == ["    if a > 0.0:", "        pass", "    else:"]
    for value in (-2.0, 3.0):
        assert called(["    a = given", *rename_values(lines)], value) == abs(value)


def test_nothing_is_left_of_an_empty_else() -> None:
    lines = ["    t1 = a + 1.0", "    if a > 0.0:", "        c2 = -t1", "    else:", "        c2 = t1", "    return c2"]
    assert rename_values(lines)[1:] == ["    if a > 0.0:", "        t1 = -t1", "    return t1"]


def test_both_sides_of_a_copy_stay_apart_while_both_are_needed() -> None:
    lines = ["    t1 = given + 1.0", "    t2 = t1", "    t1 = t1 * 2.0", "    return t1, t2"]
    assert called(rename_values(lines), 3.0) == (8.0, 4.0)


STEPS = st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40), st.integers(0, 3)), min_size=1, max_size=40)


@settings(max_examples=200)
@given(STEPS)
def test_random_programs_compute_the_same(steps: list[tuple[int, int, int]]) -> None:
    lines, names = ["    a, b = given"], ["a", "b"]
    for k, (i, j, kind) in enumerate(steps):
        x, y, new = names[i % len(names)], names[j % len(names)], f"t{k}"
        if kind == 0:
            lines.append(f"    {new} = {x} - {y}")
        elif kind == 1:
            lines.append(f"    {new} = {x}")
        elif kind == 2:
            lines += [f"    if {x} > {y}:", f"        {new} = {x}", "    else:", f"        {new} = {y} + 1.0"]
        else:
            lines += [f"    {new} = {x}", "    for _ in range(2):", f"        {new} = {new} - 0.5 * {y}"]
        names.append(new)
    lines.append(f"    return ({', '.join(names[-3:])})")
    assert called(rename_values(lines), (1.25, -3.5)) == called(lines, (1.25, -3.5))
