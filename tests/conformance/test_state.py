"""Saved states: handles, buffers, and bytes that are not what was saved."""

from __future__ import annotations

import json
import math
from binascii import crc32
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stimuli import rows
from subjects import ERROR, OK, Instance, Subject, refused

from gapsense.fmi.components import kernel_of
from gapsense.fmi.sentences import SENTENCES, say

FUZZ = settings(max_examples=30, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])


def saved(one: Instance, count: int = 7) -> str:
    """Bytes of an instance that has made some steps."""
    one.again("running").run(rows(one.subject.component, count))
    one.all(("GetFMUstate", 0))
    data: str = one.do("SerializeFMUstate", 0).value
    one.all(("FreeFMUstate", 0))
    return data


def test_handles_are_kept_emptied_and_may_be_none(subject: Subject, one: Instance) -> None:
    one.bring("running")
    for _ in range(3):
        answer = one.do("GetFMUstate", 0)
        assert answer.status == OK and answer.value, "another handle for the same state"
    assert one.do("FreeFMUstate", 0) == (OK, None, [])
    assert one.do("FreeFMUstate", 0) == (OK, None, [])
    assert one.do("FreeFMUstate", None) == (OK, None, [])
    answer = one.do("SetFMUstate", None)
    assert answer.status == ERROR and len(answer.log) == 1


def test_small_buffer_is_refused_and_nothing_written(subject: Subject, one: Instance) -> None:
    one.bring("running")
    one.all(("GetFMUstate", 0))
    size = len(one.do("SerializeFMUstate", 0).value) // 2
    for small in (0, 4, size - 1):
        one.all(("SetFMUstate", 0))
        answer = one.do("SerializeFMUstate", 0, small)
        refused(answer, subject.said(say("small_buffer", size, small)))
        assert set(bytes.fromhex(answer.value)) <= {ord("#"), 0}
        assert one.do("SetReal", [0], [0.0]).status == ERROR  # the instance has failed
    one.all(("SetFMUstate", 0), ("FreeFMUstate", 0))


def damage(draw: Callable[[Any], Any], data: bytes, other: bytes) -> bytes:
    """The bytes flipped, cut, extended, or spliced with those of another state."""
    kind = draw(st.sampled_from(["flip", "cut", "extend", "splice", "replace"]))
    at = draw(st.integers(0, len(data) - 1))
    if kind == "flip":
        return data[:at] + bytes([data[at] ^ draw(st.integers(1, 255))]) + data[at + 1 :]
    if kind == "cut":
        return data[:at] + data[at + draw(st.integers(1, 40)) :]
    if kind == "extend":
        return data[:at] + draw(st.binary(min_size=1, max_size=20)) + data[at:]
    if kind == "splice":
        return data[:at] + other[at:]
    return draw(st.binary(max_size=300))


def test_damaged_bytes_are_refused_and_change_nothing(subject: Subject, one: Instance) -> None:
    data, other = bytes.fromhex(saved(one)), bytes.fromhex(saved(one, 12))
    values, outputs = one.values(), one.outputs()

    @FUZZ
    @given(st.data())
    def damaged(chosen: Any) -> None:
        broken = damage(chosen.draw, data, other)
        answer = one.do("DeSerializeFMUstate", broken.hex(), 1)
        if broken in (data, other):
            assert answer.status == OK
            return
        assert answer.status == ERROR and len(answer.log) == 1
        assert is_said_of_states(answer.log[0][3])
        assert (one.values(), one.outputs()) == (values, outputs)

    damaged()
    one.all(("FreeFMUstate", 1))


def is_said_of_states(text: str) -> bool:
    """True for a sentence of the table about bytes."""
    starts = [SENTENCES[key].partition("%")[0] for key in ("damaged_state", "other_build")]
    return any(start in text for start in starts)


def test_bytes_of_others_are_refused(subject: Subject, one: Instance, subjects: dict[Any, Subject]) -> None:
    others = [other for other in subjects.values() if other is not subject][:2]
    for other in others:
        strange = other.new()
        answer = one.do("DeSerializeFMUstate", saved(strange), 1)
        assert answer.status == ERROR and len(answer.log) == 1 and is_said_of_states(answer.log[0][3])
        strange.do("free")


# Python FMUs write JSON: states with the right checksum can be made up ------------------------------------------------


def made_up(data: str, change: Callable[[dict[str, Any]], Any]) -> str:
    """Bytes of a changed state."""
    state = json.loads(bytes.fromhex(data)[9:])
    text = json.dumps(change(state) or state).encode()
    return (b"%08x %b" % (crc32(text), text)).hex()


def put(*path: Any, value: Any) -> Callable[[dict[str, Any]], None]:
    """Change one entry."""

    def change(state: dict[str, Any]) -> None:
        place: Any = state
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value

    return change


FORGED: dict[str, Callable[[dict[str, Any]], Any]] = {
    "method replaced": lambda state: {"do_step": "y"},
    "one more part": put("do_step", value="y"),
    "no dictionary": lambda state: [1.0],
    "other build": put("build", value="none"),
    "build no text": put("build", value=[[]]),
    "phase": put("phase", value="flying"),
    "phase no text": put("phase", value=[{}]),
    "phase without values": put("phase", value="initializing"),
    "signals short": lambda state: put("signals", value=state["signals"][:-1])(state),
    "signals long": lambda state: put("signals", value=[*state["signals"], 0.0])(state),
    "signals nested": put("signals", 0, value=[0.0]),
    "signals text": put("signals", 0, value="0.0"),
    "signals whole": put("signals", 0, value=10**400),
    "output not finite": put("signals", -1, value=math.nan),
    "parameters short": lambda state: put("parameters", value=state["parameters"][:-1])(state),
    "parameter true": put("parameters", 0, value=True),
    "parameter huge": put("parameters", 0, value=10**400),
    "parameter none": put("parameters", 0, value=None),
    "parameter not finite": put("parameters", 0, value=math.nan),
    "start not finite": put("start_time", value=math.inf),
    "end infinite": put("end", value=-math.inf),
    "elapsed long": put("elapsed", value=1e9),
    "elapsed negative": put("elapsed", value=-1e-9),
    "values short": lambda state: put("par", value=state["par"][:-1])(state),
    "values others": put("par", 0, value=-7.5),
    "values nested": put("par", 0, value=[[1.0]]),
    "state short": lambda state: put("state", value=state["state"][:-1])(state),
    "state whole": put("state", 0, value=10**400),
    "state nested": put("state", 0, value=[[[[0.0]]]]),
    "state text": put("state", 0, value="y"),
    "state none": put("state", value=None),
}


def with_number(entries: list[Any], entry: int, first: int, number: float) -> None:
    """Change a number of the kernel's state, in the memory of that entry if it is one."""
    where, place = (entries[entry], first) if isinstance(entries[entry], list) else (entries, entry)
    where[place] = number


def test_made_up_states_are_refused(subject: Subject, one: Instance) -> None:
    if subject.kind != "python":
        pytest.skip("only the bytes of Python FMUs can be read here")
    data = saved(one)
    values, outputs = one.values(), one.outputs()
    for case, change in FORGED.items():
        answer = one.do("DeSerializeFMUstate", made_up(data, change), 1)
        assert answer.status == ERROR and len(answer.log) == 1, case
        assert is_said_of_states(answer.log[0][3]) and "Traceback" not in answer.log[0][3], case
    for entry, first, _, least, most in kernel_of(subject.component).wholes:
        for number in (least - 1.0, most + 1.0, least + 0.5, 1e300, -2.1e9, math.nan, math.inf):
            forged = made_up(data, lambda state, at=(entry, first), x=number: with_number(state["state"], *at, x))
            answer = one.do("DeSerializeFMUstate", forged, 1)
            assert answer.status == ERROR and "damaged: its values cannot be right" in answer.log[0][3]
    assert (one.values(), one.outputs()) == (values, outputs)
    one.all(("DeSerializeFMUstate", made_up(data, lambda state: None), 1), ("SetFMUstate", 1), ("FreeFMUstate", 1))
