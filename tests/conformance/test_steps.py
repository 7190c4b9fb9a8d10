"""Communication steps: tiny, huge, of wrong sizes, jumps in time; and the samples within."""

from __future__ import annotations

import math

import pytest
from subjects import ERROR, OK, Answer, Instance, Subject, refused

from gapsense.fmi.sentences import say


def step(one: Instance, time: float, size: float) -> Answer:
    return one.do("DoStep", time, size, 1)


def refused_step(one: Instance, time: float, size: float, text: str) -> None:
    said = say("said_in_step", one.name, one.subject.component.name, time, size, text)
    refused(step(one, time, size), said)


@pytest.mark.parametrize("size", [0.0, -1e-3, math.nan, math.inf, -math.inf])
def test_sizes_that_are_none(subject: Subject, one: Instance, size: float) -> None:
    refused_step(one.bring("running"), 0.0, size, say("step_size", repr(size)))


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf])
def test_times_that_are_none(subject: Subject, one: Instance, time: float) -> None:
    one.bring("running")
    refused_step(one, time, subject.step, say("step_size", repr(subject.step)))


HUGE = [pytest.param(size, marks=pytest.mark.slow) for size in (1e3, 1e9)]  # an actuator divides it up: a minute


@pytest.mark.parametrize("size", [1e-300, 1e-30, 1e-15, 0.02, *HUGE])
def test_tiny_and_huge_steps_are_taken_or_refused(subject: Subject, one: Instance, size: float) -> None:
    """Sampled components take whole multiples and fractions alone; outputs stay finite in any case."""
    if subject.period:
        size = {0.02: 100.0, 1e3: 1000.0, 1e9: 10000.0}.get(size, size / subject.period) * subject.period
    one.bring("running")
    answer = step(one, 0.0, size)
    assert answer.status == OK or (answer.status == ERROR and len(answer.log) == 1)
    assert all(map(math.isfinite, one.outputs()))


JUMPS = [1.0, -1.0, 0.5, -0.5, 1e-3, -1e-3, 2e-6]  # steps


@pytest.mark.parametrize("start", [0.0, 1000.0])
@pytest.mark.parametrize("jump", JUMPS)
def test_jumps_in_time_are_refused(subject: Subject, one: Instance, start: float, jump: float) -> None:
    h = subject.period or subject.step
    time = start + jump * h
    one.bring("running", start)
    refused_step(one, time, h, say("jump", time - start, start))
    one.all(("Reset",))
    one.bring("running", start).all(("DoStep", start, h, 1))
    time, end = start + h + jump * h, start + h
    refused_step(one, time, h, say("jump", time - end, end))


def test_times_that_are_rounded_are_no_jumps(subject: Subject, one: Instance) -> None:
    h = subject.period or subject.step
    for start in (0.0, 1000.0, 1e6):
        one.all(("Reset",))
        one.bring("running", start)
        one.all(*(("DoStep", start + k * h, h, 1) for k in range(100)))
        one.all(("Reset",))
        one.bring("running", start)
        one.all(*(("DoStep", (start + k * h) * (1.0 + (-1) ** k * 3e-16), h, 1) for k in range(100)))


def test_steps_that_do_not_fit_the_samples(subject: Subject, one: Instance) -> None:
    period = subject.period
    if not period:
        pytest.skip("a component that is not sampled takes any step")
    for factor in (0.4, 0.9999, 1.0001, 1.37, 2.5):
        one.all(("Reset",))
        refused_step(one.bring("running"), 0.0, factor * period, say("no_fraction", factor * period, period))
    one.all(("Reset",))
    one.bring("running").all(("DoStep", 0.0, period / 2, 1))
    half = period / 2 + period - period
    refused_step(one, period / 2, period, say("past_sample", period, half, period))


def test_samples_do_not_depend_on_the_steps(subject: Subject, one: Instance) -> None:
    """One step of three samples, three of one, and nine of a third end in the same outputs."""
    period = subject.period
    if not period:
        pytest.skip("a component that is not sampled may give other numbers in other steps")
    ends = []
    for per, count in ((3.0, 4), (1.0, 12), (1.0 / 3.0, 36)):
        one.all(("Reset",))
        one.bring("running").all(*(("DoStep", k * per * period, per * period, 1) for k in range(count)))
        ends.append(one.outputs())
    assert ends[1] == pytest.approx(ends[0], rel=1e-9, abs=1e-12)
    assert ends[2] == pytest.approx(ends[0], rel=1e-9, abs=1e-12)
