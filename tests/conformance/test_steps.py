"""Communication steps: tiny, huge, of wrong sizes, jumps in time; and the samples within."""

from __future__ import annotations

import math

import pytest
from stimuli import rows
from subjects import ERROR, OK, Answer, Instance, Subject, refused

from gapsense.fmi.ports import Component
from gapsense.fmi.sentences import say


def step(one: Instance, time: float, size: float) -> Answer:
    return one.do("DoStep", time, size, 1)


def refused_step(one: Instance, time: float, size: float, text: str) -> None:
    said = say("said_in_step", one.name, one.subject.component.name, time, size, text)
    refused(step(one, time, size), said)


def test_sizes_and_times_that_are_none(subject: Subject, one: Instance) -> None:
    cases = [(0.0, size, size) for size in (0.0, -1e-3, math.nan, math.inf, -math.inf)]
    cases += [(time, subject.step, subject.step) for time in (math.nan, math.inf, -math.inf)]
    for time, size, told in cases:
        one.again("running")
        refused_step(one, time, size, say("step_size", repr(told)))


HUGE = [pytest.param((size,), marks=pytest.mark.slow) for size in (1e3, 1e9)]  # an actuator divides it up: seconds
MINUTES = ("PlayActuator", "ReluctanceActuator", "TableActuator")  # in Python; natively they are tried as all others


@pytest.mark.parametrize("sizes", [(1e-300, 1e-30, 1e-15, 0.02), *HUGE])
def test_tiny_and_huge_steps_are_taken_or_refused(subject: Subject, one: Instance, sizes: tuple[float, ...]) -> None:
    """Sampled components take whole multiples and fractions alone; outputs stay finite in any case.

    An actuator makes as many micro-steps of 1e3 s as of 1e9 s, the most that it makes: in Python only those of 1e9 s,
    and not those of the three that take a minute each for what the others show, that the loop ends.
    """
    is_slow = sizes == (1e3,) or (sizes == (1e9,) and subject.component.name in MINUTES)
    if subject.kind == "python" and not subject.period and is_slow:
        pytest.skip("the micro-steps of others, or of 1e9 s, are as many")
    for size in sizes:
        if subject.period:
            size = {0.02: 100.0, 1e3: 1000.0, 1e9: 10000.0}.get(size, size / subject.period) * subject.period
        one.again("running")
        answer = step(one, 0.0, size)
        assert answer.status == OK or (answer.status == ERROR and len(answer.log) == 1)
        assert all(map(math.isfinite, one.outputs()))


JUMPS = (1.0, -1.0, 0.5, -0.5, 1e-3, -1e-3, 2e-6)  # steps


def test_jumps_in_time_are_refused(subject: Subject, one: Instance) -> None:
    h = subject.period or subject.step
    for start, jump in [(start, jump) for start in (0.0, 1000.0) for jump in JUMPS]:
        time = start + jump * h
        one.again("running", start)
        refused_step(one, time, h, say("jump", time - start, start))
        one.again("running", start).all(("DoStep", start, h, 1))
        time, end = start + h + jump * h, start + h
        refused_step(one, time, h, say("jump", time - end, end))


def test_times_that_are_rounded_are_no_jumps(subject: Subject, one: Instance) -> None:
    h = subject.period or subject.step
    for start in (0.0, 1000.0, 1e6):
        one.again("running", start)
        one.all(*(("DoStep", start + k * h, h, 1) for k in range(100)))
        one.again("running", start)
        one.all(*(("DoStep", (start + k * h) * (1.0 + (-1) ** k * 3e-16), h, 1) for k in range(100)))


def test_times_so_late_that_a_step_is_lost_in_them(subject: Subject, one: Instance) -> None:
    """A run whose start was not told may begin anywhere; the samples are counted nevertheless."""
    h = subject.period or subject.step
    for time in (1e15, 1e100, 1e300):
        one.all(("Reset",), ("EnterInitializationMode",), ("ExitInitializationMode",))
        one.all(*(("DoStep", time, size, 1) for size in (h, 2.0 * h, h)))


def test_steps_that_do_not_fit_the_samples(subject: Subject, one: Instance) -> None:
    period = subject.period
    if not period:
        pytest.skip("a component that is not sampled takes any step")
    for factor in (0.4, 0.9999, 1.0001, 1.37, 2.5):
        one.all(("Reset",))
        refused_step(one.bring("running"), 0.0, factor * period, say("no_fraction", factor * period, period))
    one.again("running").all(("DoStep", 0.0, period / 2, 1))
    half = period / 2 + period - period
    refused_step(one, period / 2, period, say("past_sample", period, half, period))


def test_steps_that_are_no_whole_fraction_in_any_number(subject: Subject, one: Instance) -> None:
    period = subject.period
    if not period:
        pytest.skip("a component that is not sampled takes any step")
    for size in (5e-324, 1e-320):
        one.all(("Reset",))
        refused_step(one.bring("running"), 0.0, size, say("no_fraction", size, period))


def test_step_that_is_lost_in_the_time_holds_no_sample(subject: Subject, one: Instance) -> None:
    """Its rounding is many times the step itself."""
    period = subject.period
    if not period:
        pytest.skip("a component that is not sampled takes any step")
    row = rows(subject.component, 1, 1)[0]
    one.bring("running", 1.0).all(("DoStep", 1.0, period / 2, 1), ("SetReal", subject.refs("input"), row))
    before = one.outputs()
    assert step(one, 1.0 + period / 2, 1e-20).status == OK
    assert one.outputs() == before


# Awkward steps --------------------------------------------------------------------------------------------------------


def summed(step: float, count: int) -> list[float]:
    """Times that a host gets by adding up."""
    times = [0.0]
    for _ in range(count):
        times.append(times[-1] + step)
    return times


def differences(times: list[float]) -> list[tuple[float, float]]:
    return [(a, b - a) for a, b in zip(times, times[1:])]


WHOLE, SHORT = 1e-4, 1.0 / 60.0  # s
GRIDS = {  # (sample time, communication steps per comparison, grid of (time, step))
    "whole": (WHOLE, 1, [(k * WHOLE, WHOLE) for k in range(30)]),
    "thirds": (WHOLE, 3, [(k * WHOLE / 3, WHOLE / 3) for k in range(90)]),
    "thirds, time added up": (WHOLE, 3, [(t, WHOLE / 3) for t in summed(WHOLE / 3, 89)]),
    "thirds, step a difference": (WHOLE, 3, differences(summed(WHOLE / 3, 90))),
    "sixtieths": (SHORT, 1, [(k / 60, SHORT) for k in range(30)]),
    "sixtieths, time added up": (SHORT, 1, [(t, SHORT) for t in summed(SHORT, 29)]),
    "sixtieths, step a difference": (SHORT, 1, [(k / 60, (k + 1) / 60 - k / 60) for k in range(30)]),
    "sixtieths of five samples": (SHORT / 5, 1, [(k / 60, SHORT) for k in range(30)]),
    "samples of it": (SHORT / 5, 5, [(k * SHORT / 5, SHORT / 5) for k in range(150)]),
    "late": (WHOLE, 1, [(1000.0 + k * WHOLE, WHOLE) for k in range(30)]),
    "late, step a difference": (WHOLE, 1, differences([1000.0 + k * WHOLE for k in range(31)])),
    "late, thirds of differences": (WHOLE, 3, differences([1000.0 + k * WHOLE / 3 for k in range(91)])),
}
SAME = [
    ("whole", "thirds"),
    ("whole", "thirds, time added up"),
    ("whole", "thirds, step a difference"),
    ("sixtieths", "sixtieths, time added up"),
    ("sixtieths", "sixtieths, step a difference"),
    ("sixtieths of five samples", "samples of it"),
    ("late", "late, step a difference"),
    ("late", "late, thirds of differences"),
]


def longer_than_a_sample(component: Component) -> set[str]:
    """Times of which a sample may only be a part."""
    powers = [dict(limit.powers) for limit in component.limits]
    return {name for known in powers if known.get("sample_time") == 1 for name in known if known[name] == -1}


@pytest.fixture
def on_grids(subject: Subject, one: Instance) -> dict[str, list[list[float]]]:
    """Outputs at the end of every so many steps of each grid; inputs are held over them."""
    component, found = subject.component, {}
    for name, (sample, per, grid) in GRIDS.items():
        one.all(("Reset",))
        if subject.period:
            told = {"sample_time": sample} | {name: 100.0 * sample for name in longer_than_a_sample(component)}
            for port in (port for port in component.ports if port.name in told):
                one.set(port, told[port.name])
        one.bring("running", grid[0][0])
        stimulus, calls = rows(component, len(grid) // per), []
        for k, (time, step) in enumerate(grid):
            calls += [("SetReal", subject.refs("input"), stimulus[k // per]), ("DoStep", time, step, 1)]
            calls += [("GetReal", subject.refs("output"))]
        found[name] = [answer.value for answer in one.all(*calls)[2::3]][per - 1 :: per]
    return found


def test_awkward_steps_run(subject: Subject, on_grids: dict[str, list[list[float]]]) -> None:
    for name, (_, per, grid) in GRIDS.items():
        assert len(on_grids[name]) == len(grid) // per, name
        assert all(math.isfinite(value) for row in on_grids[name] for value in row), name
    if not subject.period:
        return  # a component that is not sampled may give other numbers in other steps
    for first, other in SAME:
        for row, found in zip(on_grids[first], on_grids[other]):
            assert found == pytest.approx(row, rel=1e-12, abs=1e-15), (first, other)
