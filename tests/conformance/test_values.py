"""Variables: references, kinds, ranges, what may be set when; the sentences are those of the tables."""

from __future__ import annotations

import math
from typing import Any

from subjects import ERROR, KINDS, OK, Instance, Subject, refused

from gapsense.fmi.ports import Component, Port
from gapsense.fmi.sentences import say
from gapsense.fmi.values import problems, wrong_value

NEVER = (math.nan, math.inf, -math.inf)
VALUE: dict[str, Any] = {"Real": 0.0, "Integer": 0, "Boolean": 0, "String": "0"}


def unknown(component: Component, kind: str) -> list[int]:
    """References that are nothing of this kind: of others, beyond the last one, and those that look negative."""
    others = [k for k, port in enumerate(component.ports) if port.kind != kind]
    return [*others[:1], *others[-1:], len(component.ports), 9999, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1]


def test_references_of_nothing_are_refused(subject: Subject, one: Instance) -> None:
    for kind, ref in [(name, ref) for name in KINDS for ref in unknown(subject.component, name)]:
        for call in (f"Get{kind}", [ref]), (f"Set{kind}", [ref], [VALUE[kind]]):
            one.again("initializing")
            refused(one.do(*call), subject.said(say("no_variable", kind, ref)))
    answer = one.again("running").do("SetReal", [0, 9999], [0.0, 0.0])
    refused(answer, subject.said(say("no_variable", "Real", 9999)))


def test_refused_setting_sets_nothing(subject: Subject, one: Instance) -> None:
    one.bring("running")
    before, inputs = one.values(), subject.refs("input")
    assert one.do("SetReal", [*inputs, len(inputs)], [3.0] * (len(inputs) + 1)).status == ERROR
    assert one.values() == before


def test_outputs_cannot_be_set(subject: Subject, one: Instance) -> None:
    for phase in ("instantiated", "initializing", "running"):
        for ref in subject.refs("output")[:2]:
            one.again(phase)
            name = subject.component.ports[ref].name
            refused(one.do("SetReal", [ref], [0.0]), subject.said(say("is_output", name)))


def test_inputs_that_are_not_finite(subject: Subject, one: Instance) -> None:
    component = subject.component
    for (k, port), value in [(item, v) for item in enumerate(component.of("input")) for v in NEVER]:
        one.again("running").all(("SetReal", [k], [value]))
        answer = one.do("DoStep", 0.0, subject.step, 1)
        if component.survives:
            assert (answer.status, answer.log) == (OK, []) and all(map(math.isfinite, one.outputs()))
            continue
        text = say("inputs_not_finite", f"`{port.name}`")
        refused(answer, in_step(subject, 0.0, subject.step, text))
        one.again("initializing").all(("SetReal", [k], [value]))
        refused(one.do("GetReal", subject.refs("output")), subject.said(text))


def in_step(subject: Subject, time: float, step: float, text: str) -> str:
    """A message of a step."""
    return say("said_in_step", "one", subject.component.name, time, step, text)


def test_inputs_beyond_their_range(subject: Subject, one: Instance) -> None:
    """Refused; at their ends, ranges are closed."""
    for k, port in enumerate(subject.component.of("input")):
        ends = ((port.min, -1.0), (port.max, 1e-9))
        beyond = [end + more for end, more in ends if end is not None]
        for value in beyond:
            one.again("running").all(("SetReal", [k], [value]))
            answer = one.do("DoStep", 0.0, subject.step, 1)
            if subject.component.survives:
                assert answer.status == OK
            else:
                text = say("correct_inputs", wrong_value(port, value))
                refused(answer, in_step(subject, 0.0, subject.step, text))
                one.again("initializing").all(("SetReal", [k], [value]))
                refused(one.do("ExitInitializationMode"), subject.said(text))
        for value in (v for v in (port.min, port.max) if v is not None):
            one.again("running").all(("SetReal", [k], [value]), ("DoStep", 0.0, subject.step, 1))


def wrong(port: Port) -> list[Any]:
    """Values that a parameter does not take, of its kind."""
    if port.choices:
        return ["nonsense", "", "%s für"]
    if port.kind not in ("Real", "Integer"):
        return []
    kind = {"Real": float, "Integer": int}[port.kind]
    ends = [v for v in (None if port.min is None else port.min - 1, None if port.max is None else port.max + 1)]
    never = NEVER if port.kind == "Real" else ()
    return [*(kind(end) for end in ends if end is not None and abs(end) < 2**31), *never]


def test_parameters_are_judged_together_in_the_words_of_the_table(subject: Subject, one: Instance) -> None:
    component = subject.component
    bad = {port.name: wrong(port)[0] for port in component.of("parameter") if wrong(port)}
    for port in component.of("parameter"):
        for value in wrong(port):
            given(one, {port.name: value})
    given(one, bad)
    starts = {p.name: p.start for p in component.ports}
    for low, high in component.rising:
        given(one, {low: starts[high], high: starts[high]})
    for limit in component.limits:
        at = {p.name: p.start or p.nominal for p in component.of("parameter") if p.name in dict(limit.powers)}
        product = math.prod(at[name] ** power for name, power in limit.powers)
        name, power = limit.powers[-1]
        given(one, {**at, name: at[name] * (1.000001 * limit.below / product) ** (1 / power)})


def given(one: Instance, values: dict[str, Any]) -> None:
    """Values that must be refused at the end of initialization."""
    one.all(("Reset",))
    ports = {port.name: port for port in one.subject.component.ports}
    for name, value in values.items():
        assert one.set(ports[name], value).status == OK
    one.bring("initializing")
    found = problems(one.subject.component, values)
    assert found, values
    refused(one.do("ExitInitializationMode"), one.subject.said(say("correct_parameters", " ".join(found))))


def test_tunable_parameters_during_a_run(subject: Subject, one: Instance) -> None:
    component = subject.component
    for port in component.of("parameter"):
        one.again("running")
        if port.variability != "tunable":
            refused(one.set(port, port.start), subject.said(say("is_fixed", port.name)))
            continue
        assert one.set(port, port.start).log == []
        for value in wrong(port)[:1]:
            text = say("correct_parameters", " ".join(problems(component, {port.name: value})))
            refused(one.set(port, value), subject.said(text))
            assert one.do("GetReal", [component.ports.index(port)]).value == [port.start]


def test_texts_come_back_as_they_were(subject: Subject, one: Instance) -> None:
    for ref in subject.refs("parameter", "String"):
        for text in ("", "für 100 %s %n", "a" * 5000, "\U0001f9f2"):
            one.all(("Reset",), ("SetString", [ref], [text]))
            one.bring("initializing")
            assert one.do("GetString", [ref]).value == [text]
