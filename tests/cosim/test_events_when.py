"""Conditions of events, and events on parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from events_text import HEAD, RAMP, event
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.cosim import FmuError, run
from gapsense.cosim.run.loop import compiled

BASE, COUNT = 0.1, 20
WATCHED = f"""{HEAD}
[components.tuned]
fmu = "Tuned"
step = STEP
[components.probe]
fmu = "Gain"
[inputs]
"tuned.u" = 1.0
[inputs.probe.u]
times = {[k * BASE for k in range(COUNT + 1)]}
values = VALUES
interpolation = "hold"
"""


def spans(values, level, is_above, lasting, after, duration, again, lead):
    """Begin and end of each event, from the values of the signal at all base steps."""
    holds = [v > level if is_above else v < level for v in values]
    found, k, needs_false = [], after, False
    since = None
    while k <= COUNT:
        if not holds[k]:
            needs_false, since = False, None
        elif since is None:
            since = k
        if holds[k] and not needs_false and k - since >= lasting:
            begin = k + lead
            end = begin + duration if duration else None
            found += [(begin, end)] if begin <= COUNT - (1 - lead) else []
            if not again:
                break
            needs_false, k = True, end - lead
            since = None
        k += 1
    return found


@st.composite
def conditions(draw):
    """A signal, and what is asked of it."""
    values = [float(v) for v in draw(st.lists(st.integers(0, 4), min_size=COUNT + 1, max_size=COUNT + 1))]
    duration = draw(st.integers(0, 4))
    more = {"for": draw(st.integers(0, 3)), "after": draw(st.integers(0, 9))}
    again = bool(duration) and draw(st.booleans())
    return values, draw(st.integers(0, 4)), draw(st.booleans()), more, duration, again, draw(st.booleans())


@settings(max_examples=25, deadline=None)
@given(case=conditions(), step=st.integers(1, 2), method=st.sampled_from(["gauss-seidel", "jacobi"]))
def test_condition_begins_and_ends_events_as_counted_by_hand(fmus, tmp_path_factory, case, step, method):
    values, level, is_above, more, duration, again, is_input = case
    when = {"signal": "probe.u", "above" if is_above else "below": float(level), "again": again}
    when |= {key: k * BASE for key, k in more.items() if k}
    text = WATCHED.replace("VALUES", str(values)).replace("STEP", str(step))
    target, value = ("tuned.u", 5.0) if is_input else ("tuned.gain", 3.0)
    text += event("now", target, "set", value=value, duration=duration * BASE or None, when=when)
    path = tmp_path_factory.mktemp("when") / "scenario.toml"
    path.write_text(text.replace("base_step = 0.1", f'base_step = 0.1\nmethod = "{method}"'))
    result = run(path, fmus=fmus)
    asked = (values, level, is_above, more["for"], more["after"], duration, again, int(is_input))
    found = [(round(s.begin / BASE), None if s.end is None else round(s.end / BASE)) for s in result.events]
    last = COUNT if is_input else COUNT - 1  # after the last base step nothing is prepared
    assert found == [(b, e if e is not None and e <= last else None) for b, e in spans(*asked)]
    if step == 1 and is_input:
        on = {k for b, e in spans(*asked) for k in range(b, COUNT + 1 if e is None else e)}
        assert result["tuned.u"].tolist() == [5.0 if k in on else 1.0 for k in range(COUNT + 1)]


def test_condition_is_the_same_without_the_library(write, fmus, monkeypatch):
    values = [float(k % 5) for k in range(COUNT + 1)]
    when = {"signal": "probe.u", "above": 2.5, "again": True}
    text = WATCHED.replace("VALUES", str(values)).replace("STEP", "1")
    path = write(text + event("now", "tuned.u", "noise", value=2.0, duration=0.3, when=when))
    one = run(path, fmus=fmus)
    monkeypatch.setattr(compiled, "BINARY", Path("none.so"))
    other = run(path, fmus=fmus)
    assert len(one.events) == 4 and one.events == other.events
    assert all(one[name].tobytes() == other[name].tobytes() for name in one.signals)


# Parameters -----------------------------------------------------------------------------------------------------------


def gains(result, step=1):
    """Gain in each step, from what was added up."""
    return np.diff(result["tuned.y"][::step]) / (BASE * step)


def test_parameter_has_its_value_in_the_steps_from_begin_to_end(write, fmus):
    result = run(write(RAMP + event("more", "tuned.gain", "set", value=5.0, at=0.5, until=0.8)), fmus=fmus)
    np.testing.assert_allclose(gains(result), [2.0] * 5 + [5.0] * 3 + [2.0] * 12, rtol=1e-9)
    assert result.parameters["tuned.gain"] == 2.0
    assert [(s.target, s.action, s.begin, s.end) for s in result.events] == [("tuned.gain", "set", 0.5, 0.8)]


@pytest.mark.parametrize("isolation", ["none", "process"])
def test_slow_component_takes_a_parameter_where_a_step_of_it_begins(write, fmus, isolation):
    """Begin and end in the midst of its steps count from the next one on."""
    text = RAMP.replace('"Tuned"', f'"Tuned"\nstep = 4\nisolation = "{isolation}"')
    result = run(write(text + event("more", "tuned.gain", "set", value=5.0, at=0.5, until=1.3)), fmus=fmus)
    np.testing.assert_allclose(gains(result, 4), [2.0, 2.0, 5.0, 5.0, 2.0], rtol=1e-9)


@pytest.mark.parametrize("step", [1, 2])
def test_ramp_of_a_parameter_is_a_staircase_on_the_line(write, fmus, step):
    text = RAMP.replace('"Tuned"', f'"Tuned"\nstep = {step}')
    result = run(write(text + event("warm", "tuned.gain", "ramp", value=10.0, over=0.8, at=0.4)), fmus=fmus)
    times = np.arange(0, COUNT, step)
    np.testing.assert_allclose(gains(result, step), np.interp(times, [4, 12], [2.0, 10.0]), rtol=1e-9)


def test_events_on_one_parameter_act_in_the_order_of_the_file(write, fmus):
    add, twice = (
        event("add", "tuned.gain", "bias", value=1.0, at=0.5),
        event("twice", "tuned.gain", "scale", value=2.0, at=1.0),
    )
    first, second = (
        run(write(RAMP + text, name), fmus=fmus) for name, text in (("a", add + twice), ("b", twice + add))
    )
    np.testing.assert_allclose(gains(first)[[0, 5, 10]], [2.0, 3.0, 6.0], rtol=1e-9)
    np.testing.assert_allclose(gains(second)[[0, 5, 10]], [2.0, 3.0, 5.0], rtol=1e-9)


def test_whole_number_is_set_as_one(write, fmus):
    result = run(write(RAMP + event("three", "tuned.mode", "set", value=3, at=1.0)), fmus=fmus)
    np.testing.assert_allclose(gains(result), [2.0] * 10 + [6.0] * 10, rtol=1e-9)


def test_component_that_refuses_a_value_names_event_and_time(write, fmus):
    noisy = event("noisy", "tuned.gain", "bias", value=11.0, at=0.5)  # the FMU fails at 13, in the step
    with pytest.raises(FmuError) as caught:
        run(write(RAMP + noisy), fmus=fmus)
    assert (caught.value.instance, caught.value.time) == ("tuned", 0.5)
    assert "unlucky gain" in str(caught.value)
    assert [span.name for span in caught.value.result.events] == ["noisy"]
