"""The life of an instance: which calls are allowed when, and what a refusal leaves behind."""

from __future__ import annotations

import math
from typing import Any

from subjects import DISCARD, ERROR, OK, Instance, Subject, refused

from gapsense.fmi.life import ALLOWED, KINDS, PHASES, phases_of
from gapsense.fmi.sentences import say


def trial(subject: Subject, call: str) -> tuple[Any, ...]:
    """Good arguments for a call, but for its phase."""
    name, kind = call.removeprefix("fmi2"), call[-4:]
    if name in ("SetupExperiment", "DoStep"):
        return {"SetupExperiment": (name, 0, 0.0, 0.0, 0, 0.0), "DoStep": (name, 0.0, subject.step, 1)}[name]
    if name[3:] in KINDS:
        return (name, [], []) if name[:3] == "Set" else (name, [])
    return (name,) if kind else ()


def test_calls_are_allowed_in_their_phases_alone(subject: Subject, one: Instance) -> None:
    for phase, (call, phases) in [(phase, item) for phase in PHASES for item in ALLOWED.items()]:
        one.again(phase)
        name, *arguments = trial(subject, call)
        answer = one.do(name, *arguments)
        if phase in phases:
            assert (answer.status, answer.log) == (OK, []), (call, phase)
            continue
        sentence = say("wrong_phase", call, phase, phases_of(call))
        said = ("said_in_step", 0.0, subject.step) if name == "DoStep" else ("said",)
        refused(answer, say(said[0], "one", subject.component.name, *said[1:], sentence))
        assert "`failed`" in one.do("DoStep", 0.0, subject.step, 1).log[0][3], (call, phase)


def test_some_calls_are_always_allowed(subject: Subject, one: Instance) -> None:
    for phase in PHASES:
        one.again(phase)
        one.all(("SetDebugLogging", 1, []), ("GetFMUstate", 0), ("SerializeFMUstate", 0))
        data = one.do("SerializeFMUstate", 0).value
        one.all(("DeSerializeFMUstate", data, 1), ("SetFMUstate", 1), ("SetFMUstate", 0))
        one.all(("FreeFMUstate", 0), ("FreeFMUstate", 1))
    one.again("running").run([[p.start for p in subject.component.of("input")]])


def test_failed_instance_can_be_read_reset_and_brought_back(subject: Subject, one: Instance) -> None:
    one.bring("running")
    one.all(("GetFMUstate", 0))
    before = one.outputs(), one.values()
    assert one.do("DoStep", 0.0, -1.0, 1).status == ERROR
    assert (one.outputs(), one.values()) == before
    inputs = [p.start for p in subject.component.of("input")]
    one.all(("SetFMUstate", 0))
    once = one.run([inputs])
    one.all(("SetFMUstate", 0), ("Reset",))
    one.bring("running")
    assert (one.outputs(), one.values()) == before
    assert one.run([inputs]) == once
    one.all(("FreeFMUstate", 0))


def test_what_is_not_provided_says_so_and_changes_no_phase(subject: Subject, one: Instance) -> None:
    one.bring("running")
    for name in ("SetRealInputDerivatives", "GetRealOutputDerivatives", "GetDirectionalDerivative", "CancelStep"):
        refused(one.do(name), subject.said(say("not_provided", f"fmi2{name}")))
    for kind in ("", *KINDS):
        assert one.do("status_of", kind).status == DISCARD
    one.run([[p.start for p in subject.component.of("input")]])


OTHER = "{00000000-0000-0000-0000-000000000000}"
NEVER: dict[str, tuple[dict[str, Any], str]] = {
    "model exchange": ({"kind": 0}, say("model_exchange")),
    "no guid": ({"guid": None}, ""),
    "other guid": ({"guid": OTHER}, OTHER),
    "no resources": ({"resources": None}, ""),
    "resources elsewhere": ({"resources": "file:///nowhere/at/all"}, ""),
}


def test_instance_that_cannot_be_is_refused_with_one_message(subject: Subject) -> None:
    """A native component without files does not look for any."""
    for (case, (given, words)), log in [(item, log) for item in NEVER.items() for log in (0, 1)]:
        if "resources" in case and subject.kind == "native" and not subject.component.resources:
            continue
        answer = subject.instantiate(log=log, **given)
        assert answer.value is None, case
        ((name, status, category, text),) = answer.log
        assert (name, status, category) == ("one", ERROR, "logStatusError")
        assert words in text and text.endswith("."), case


def test_start_that_is_not_finite_is_refused(subject: Subject, one: Instance) -> None:
    for time in (math.nan, math.inf, -math.inf):
        one.all(("Reset",))
        refused(one.do("SetupExperiment", 0, 0.0, time, 0, 0.0), subject.said(say("start_time", repr(time))))


def test_start_need_not_be_told(subject: Subject, one: Instance) -> None:
    """Without it a run may begin at any time."""
    one.all(("EnterInitializationMode",), ("ExitInitializationMode",), ("DoStep", 1000.0, subject.step, 1))
