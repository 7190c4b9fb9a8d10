"""What the component `Ertss` takes for a motion, and that all motions are published, however they follow each other.

Without debouncing and without a queue, as it was: a bounce of 3 samples after a landing took the place of the motion,
and its speed was reported; so did one sample of mode 2 in hold; of two quick operations the first was cut off; nothing
was said of a motion of more than 1,024 samples.
"""

from __future__ import annotations

from itertools import chain, repeat

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from smoother_runs import assert_published, stepped
from valve_signals import T_S, exact, valve

from gapsense.estimators.motions import LENGTH
from gapsense.scenarios.soft_landing.rts import Posterior, motions, smooth_record

DEBOUNCE = 10 * T_S
LANDED = 170  # the first landing of the valve; it takes off again at 627
OPERATION = ("takeoff_time", "landing_time", "impact_speed", "bounces", "rest_time")


def run(mode: np.ndarray, debounce: float) -> tuple[dict[str, np.ndarray], Posterior]:
    """The valve's two motions with another contact signal, from the component and from the record."""
    s = valve()
    current = s.current + 2e-3 * np.random.default_rng(3).standard_normal(s.current.size)
    found = stepped(s.voltage, current, mode, exact(), debounce)
    return found, smooth_record(s.voltage, current, mode, exact(), debounce)


def moving(*samples: range) -> np.ndarray:
    """The valve's contact signal, with samples in motion that were at rest."""
    mode = valve().mode.copy()
    mode[[*chain(*samples)]] = 2.0
    return mode


def at(found: dict[str, np.ndarray], row: int) -> dict[str, float]:
    """The last operation as told at a sample."""
    return {name: float(found[name][row]) for name in OPERATION}


@pytest.mark.parametrize("bounces", [(3, 2), (1,), (10, 10)], ids=str)
def test_bounces_are_told_apart_from_the_first_impact(bounces: tuple[int, ...]) -> None:
    after, samples = LANDED + 1, []
    for length in bounces:
        samples.append(range(after, after + length))
        after += length + 1
    (clean, _), (found, record) = run(valve().mode, DEBOUNCE), run(moving(*samples), DEBOUNCE)
    landing, then = at(found, LANDED), at(found, 600)
    assert landing == at(clean, LANDED) and landing["impact_speed"] == pytest.approx(1.32, rel=0.04)
    told = landing | {"bounces": float(len(bounces)), "rest_time": (after - 1) * T_S}
    assert then == pytest.approx(told, rel=1e-12)
    assert then["rest_time"] == pytest.approx(record.operations[0].rest_time)
    assert [o.bounces for o in record.operations] == [len(bounces), 0]
    assert motions(moving(*samples)) != motions(moving(*samples), 10.0) == motions(valve().mode)
    assert_published(found, record.smoothed, np.r_[77:170, 627:759])
    np.testing.assert_array_equal(record.smoothed.position[77:170], found["smoothed_position"][262:355])


def test_a_bounce_may_be_longer_than_the_debounce() -> None:
    """It was a motion before, and took the place of the first impact: 0.1 to 0.7 ms late, with a tenth of its speed."""
    (clean, _), (found, record) = (
        run(mode, DEBOUNCE) for mode in (valve().mode, moving(range(171, 204), range(205, 212)))
    )
    assert [(o.first, o.landed, o.bounces) for o in record.operations] == [(77, 170, 2), (627, 759, 0)]
    assert_published(found, record.smoothed, np.r_[77:170, 627:759])
    assert at(found, 600) == pytest.approx(at(clean, LANDED) | {"bounces": 2.0, "rest_time": 212 * T_S}, rel=1e-12)


def test_a_motion_that_comes_back_after_a_rest_is_a_motion() -> None:
    found, record = run(moving(range(LANDED + 12, LANDED + 24)), DEBOUNCE)
    assert [(o.first, o.landed) for o in record.operations] == [(77, 170), (182, 194), (627, 759)]
    assert_published(found, record.smoothed, np.r_[77:170, 182:194, 627:759])
    assert at(found, 600)["bounces"] == 0.0


def test_two_glitches_in_hold_are_no_bounce() -> None:
    (clean, _), (found, record) = (
        run(mode, DEBOUNCE) for mode in (valve().mode, moving(range(300, 302), range(303, 304)))
    )
    assert at(found, 626) == at(clean, 626) and record.operations[0].bounces == 0


@pytest.mark.parametrize("glitch", [200, 300, 620], ids=["before it is smoothed", "before it is published", "later"])
def test_a_glitch_in_hold_is_neither_motion_nor_bounce(glitch: int) -> None:
    (clean, _), (found, record) = run(valve().mode, DEBOUNCE), run(moving(range(glitch, glitch + 1)), DEBOUNCE)
    assert at(found, 626) == at(clean, 626) and record.operations[0].bounces == 0
    assert_published(found, record.smoothed, np.r_[77:170, 627:759])


@pytest.mark.parametrize("rest", [12, 20, 60])
def test_quick_operations_are_all_published(rest: int) -> None:
    """Each lands before the one before it is smoothed, or before it is published."""
    first = LANDED + rest
    mode = moving(range(first, first + 40), range(first + 40 + rest, first + 80 + rest))
    found, record = run(mode, DEBOUNCE)
    assert len(record.operations) == 4
    assert_published(found, record.smoothed, np.concatenate([np.arange(o.first, o.landed) for o in record.operations]))
    for o in record.operations:
        assert at(found, o.landed) == pytest.approx({name: getattr(o, name) for name in OPERATION}, abs=1e-12)


def test_of_a_long_motion_the_last_samples_are_smoothed() -> None:
    lengths = np.array([5, LENGTH + 300, 40, LENGTH, 2 * LENGTH])
    mode = np.repeat([3.0, 2.0, 1.0, 2.0, 3.0], lengths)
    rest = np.zeros(mode.size)
    found, record = stepped(rest, rest, mode, exact()), smooth_record(rest, rest, mode, exact())
    long, whole = record.operations
    assert_published(found, record.smoothed, np.r_[long.landed - LENGTH : long.landed, whole.first : whole.landed])
    told = {name: getattr(long, name) for name in OPERATION}
    assert told["takeoff_time"] == 4 * T_S and told["impact_speed"] > 0.0
    assert at(found, long.landed) == pytest.approx(told, abs=1e-12)


def test_a_short_motion_to_the_other_stop_is_a_motion() -> None:
    assert motions([3, 3, 2, 1, 1, 2, 1, 1], 10.0) == [(2, 3)]


def test_a_motion_that_was_not_seen_to_take_off_is_none() -> None:
    mode = np.repeat([2.0, 1.0, 2.0, 3.0], [20, 20, 20, 60])
    rest = np.zeros(mode.size)
    found, record = stepped(rest, rest, mode, exact()), smooth_record(rest, rest, mode, exact())
    assert_published(found, record.smoothed, np.arange(40, 60))


def published_once(times: list[tuple[int, int]], debounce: int, memory: int = LENGTH) -> None:
    """Times in motion and at rest by turns: every motion is published once and in order, as the record has it.

    Of a motion of more samples than the memory is for these are the last ones; its landing and speed are those of all.
    """
    runs = [(3.0, 4), *chain(*(zip((2.0, 1.0 if k % 3 else 3.0), pair) for k, pair in enumerate(times)))]
    mode = np.concatenate([*(np.full(length, q) for q, length in runs), np.full(3 * LENGTH, 1.0)])
    wave = 5.0 * np.sin(0.05 * np.arange(mode.size))
    found = stepped(wave, 0.01 * wave, mode, exact(), debounce * T_S, memory)
    record = smooth_record(wave, 0.01 * wave, mode, exact(), debounce * T_S)
    samples = [np.arange(max(a, b - memory), b) for a, b in motions(mode, debounce)]
    assert_published(found, record.smoothed, np.concatenate([np.zeros(0, int), *samples]))
    if record.operations:
        told = {name: getattr(record.operations[-1], name) for name in OPERATION}
        assert at(found, -1) == pytest.approx(told, rel=1e-9, abs=1e-12)


lengths = st.one_of(st.integers(1, 4), st.integers(1, 60))


@settings(max_examples=12)
@given(st.lists(st.tuples(lengths, lengths), max_size=12), st.integers(0, 6), st.sampled_from((2, 7, 30, LENGTH)))
def test_every_motion_is_published_once_and_in_order(
    times: list[tuple[int, int]], debounce: int, memory: int
) -> None:  # fmt: skip
    published_once(times, debounce, memory)


@pytest.mark.parametrize(
    "times",
    [
        [(LENGTH, 1), *repeat((1, 1), LENGTH), (LENGTH, 1)],  # the longest wait that there is
        [(LENGTH, 1), (1, 1), (LENGTH, 1), (LENGTH - 1, 1), (1, 1), (2, 1)],
        [(1, 1)] * (3 * LENGTH),
    ],
    ids=["waiting longest", "long and short", "shortest"],
)
def test_no_crowd_of_motions_is_too_dense(times: list[tuple[int, int]]) -> None:
    published_once(times, 0)


def test_an_impact_before_the_memory_is_no_landing() -> None:
    """A motion of 42 samples had its landing after one of them, of which nothing was kept."""
    before = [(2, 58), (1, 3), (1, 55), (4, 4), (42, 56), (47, 3), (19, 2), (51, 53), (1, 1), (1, 1)]
    published_once([*before, (42, 1), (1, 1)], 1, 2)


@pytest.mark.parametrize("memory", [2, 3, 31])
def test_nor_for_less_memory(memory: int) -> None:
    published_once([(memory, 1), *repeat((1, 1), memory), (memory, 1), (memory + 9, 1), *repeat((1, 1), 9)], 0, memory)
