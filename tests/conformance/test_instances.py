"""Several instances, and several lives of one: the same bits as alone and fresh."""

from __future__ import annotations

import math

from stimuli import rows, tuned
from subjects import Instance, Subject

STEPS = 60


def fresh(subject: Subject, seed: int = 0) -> list[list[float]]:
    """Outputs of an instance of its own."""
    one = subject.new()
    one.bring("running")
    found = one.run(rows(subject.component, STEPS, seed))
    one.do("free")
    return found


def test_reset_is_fresh(subject: Subject, one: Instance) -> None:
    """Whatever the instance went through: values, parameters, steps, a failure."""
    expected, tuning = fresh(subject), tuned(subject.component)
    starts = one.bring("initializing").values()
    for phase in ("initializing", "running", "terminated", "failed"):
        one.all(("Reset",))
        if phase == "terminated":
            one.bring("running").run(rows(subject.component, 20, 1))
            one.all(("SetReal", list(tuning), list(tuning.values())), ("Terminate",))
        else:
            one.bring("instantiated").all(("SetReal", list(tuning), list(tuning.values())))
            one.bring(phase)
        one.all(("Reset",))
        assert one.bring("initializing").values() == starts
        one.all(("ExitInitializationMode",))
        one.time = 0.0
        assert one.run(rows(subject.component, STEPS)) == expected, phase


def test_interleaved_instances_are_single_ones(subject: Subject) -> None:
    expected = [fresh(subject, seed) for seed in range(3)]
    assert expected[0] != expected[1] or len(subject.refs("input")) == 0
    stimuli = [rows(subject.component, STEPS, seed) for seed in range(3)]
    several = [subject.new(f"number {seed}").bring("running") for seed in range(3)]
    found: list[list[list[float]]] = [[], [], []]
    for k in range(STEPS):
        for instance, stimulus, outputs in zip(several, stimuli, found):
            outputs += instance.run(stimulus[k : k + 1])
    assert found == expected
    for instance in several:
        instance.do("free")


def test_failure_of_one_is_not_felt_by_another(subject: Subject, one: Instance) -> None:
    expected, stimulus = fresh(subject), rows(subject.component, STEPS)
    other = subject.new("other").bring("running")
    one.bring("running")
    found = one.run(stimulus[:10])
    other.do("DoStep", math.nan, math.nan, 1)
    other.do("SetReal", [2**32 - 1], [0.0])
    found += one.run(stimulus[10:30])
    other.do("free")
    assert found + one.run(stimulus[30:]) == expected


def test_state_of_one_continues_in_another(subject: Subject, one: Instance) -> None:
    """From a handle, once and again, and from bytes; tuned parameters come along."""
    stimulus, tuning = rows(subject.component, STEPS), tuned(subject.component)
    one.bring("running").run(stimulus[:20])
    one.all(("SetReal", list(tuning), list(tuning.values())), ("GetFMUstate", 0))
    data, time, values = one.do("SerializeFMUstate", 0).value, one.time, one.values()
    straight = one.run(stimulus[20:])
    for _ in range(2):
        one.all(("SetFMUstate", 0))
        assert one.values() == values
        one.time = time
        assert one.run(stimulus[20:]) == straight
    other = subject.new("other")
    other.all(("DeSerializeFMUstate", data, 1), ("SetFMUstate", 1), ("SerializeFMUstate", 1))
    assert other.do("SerializeFMUstate", 1).value == data
    other.time = time
    assert other.run(stimulus[20:]) == straight
    other.all(("FreeFMUstate", 1))
    other.do("free")
    one.all(("FreeFMUstate", 0))


def test_names_may_be_anything(subject: Subject) -> None:
    """Percent signs are no formats; bytes that are no UTF-8 may be refused, or come back."""
    for name in ("für 100 %s %n #1", "", "x" * 3000):
        one = subject.new(name)
        ((who, _, _, text),) = one.do("DoStep", 0.0, 1.0, 1).log
        assert who == name and text.startswith(f"`{name}` (")
        one.do("free")
    for name in ("latin \udce9", None):
        answer = subject.instantiate(name)
        assert answer.value is not None or len(answer.log) == 1
