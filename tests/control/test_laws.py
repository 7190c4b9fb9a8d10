"""Approaches get slower as long as they are in time; what is kept is read as it was written."""

import numpy as np
import pytest
from commanded import parameters
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.control import laws
from gapsense.control.mover import NUMBERS
from gapsense.control.records import CLOSING, LAW, OPENING
from gapsense.kernels.layout import zeros

PAR = parameters()
FIRST = laws.first(PAR.closing_travel, 0.0, PAR)
LEAST = PAR.approach_least
SPEEDS = st.floats(PAR.approach_least, PAR.approach_first)


def written(*known):
    memory = zeros(2 * LAW)
    for half, law in enumerate(known):
        memory = laws.write(memory, float(half), law)
    return memory


@settings(max_examples=20)
@given(st.lists(st.floats(-1.0, 1.0), min_size=40, max_size=40))
def test_both_kinds_are_read_as_they_were_written(numbers):
    ones = [
        FIRST._replace(mean=n[0], cov=np.outer(n[1], n[1]), slopes=n[2], trend=n[3], speed=n[4, 0])
        for n in np.reshape(numbers, (2, 5, NUMBERS))
    ]
    memory = written(*ones)
    for half, law in enumerate(ones):
        read = laws.read(memory, float(half))
        assert np.array_equal(np.array(read.mean, float), law.mean) and np.allclose(np.array(read.cov, float), law.cov)
        assert np.array_equal(np.array(read.slopes, float), law.slopes) and tuple(read[4:]) == tuple(law[4:])
        assert np.array_equal(np.array(read.trend, float), law.trend)


def test_landings_in_time_make_approaches_as_slow_as_allowed():
    law, speeds = FIRST, []
    for _ in range(8):
        law = laws.choose_approach(law, CLOSING, 1.0, False, LEAST, PAR)
        speeds.append(law.speed)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == laws.SHRINK * PAR.approach_first and speeds[-1] == PAR.approach_least


@pytest.mark.parametrize(("law", "by_model", "first"), [(0.0, 0.0, 0.4), (0.0, 1.0, laws.EXPLAINED), (1.0, 1.0, 0.4)])
def test_first_approaches_are_slower_once_a_contact_has_handed_over(law, by_model, first):
    """An estimator has explained the mover by then; alone it begins as it is told, and a slower one stays."""
    par = PAR._replace(law=law, approach_first=0.4)
    known = laws.first(3.4e-3, by_model, par)
    assert known.speed == laws.forget(known._replace(speed=LEAST), by_model, par).speed == first
    assert laws.first(3.4e-3, by_model, par._replace(approach_first=0.1)).speed == 0.1


@pytest.mark.parametrize(("least", "slowest"), [(2.0 * LEAST, 2.0 * LEAST), (9.0, laws.HIGHEST_FLOOR)])
def test_approaches_stay_as_fast_as_noise_makes_landings(least, slowest):
    law = FIRST
    for _ in range(8):
        law = laws.choose_approach(law, CLOSING, 1.0, False, least, PAR)
    assert law.speed == law.floor == slowest
    for _ in range(300):  # and the noise goes
        law = laws.choose_approach(law, CLOSING, 1.0, False, LEAST, PAR)
    assert law.speed == pytest.approx(LEAST, abs=1e-3)


@pytest.mark.parametrize("has_landed", [0.0, 1.0])
@given(speed=SPEEDS, floor=SPEEDS)
def test_late_landing_makes_the_next_approach_faster_and_leaves_a_floor(has_landed, speed, floor):
    law = FIRST._replace(speed=speed, floor=floor)
    late = laws.choose_approach(law, CLOSING, has_landed, True, LEAST, PAR)
    assert late.speed == pytest.approx(min(speed / laws.SHRINK, PAR.approach_first))
    assert late.floor == pytest.approx(min(max(floor, laws.RAISE * speed), laws.HIGHEST_FLOOR))
    again = laws.choose_approach(late, CLOSING, 1.0, False, LEAST, PAR)
    assert PAR.approach_least <= again.floor <= late.floor and again.speed >= again.floor


@pytest.mark.parametrize(("half", "keeps"), [(CLOSING, True), (OPENING, False)])
def test_an_estimator_that_takes_a_floating_closing_for_landed_does_not_slow_the_next_one(half, keeps):
    law = FIRST._replace(floated=1.0)
    new = laws.choose_approach(law, half, 1.0, False, LEAST, PAR)
    assert new.missed == 0.0 and (new.speed == law.speed) == keeps


def test_floor_fades():
    law = FIRST._replace(floor=laws.HIGHEST_FLOOR, speed=0.1)
    for _ in range(300):
        law = laws.choose_approach(law, CLOSING, 1.0, False, LEAST, PAR)
    assert law.floor == pytest.approx(PAR.approach_least, abs=1e-3)


def test_misses_are_counted_in_a_row():
    """One counts as `UNJUDGED` with its end, and whole once it is judged."""
    counts, law = [], FIRST
    for has_landed in (0.0, 0.0, 1.0, 0.0):
        law = law._replace(missed=law.missed + laws.UNJUDGED)
        law = laws.choose_approach(law, CLOSING, has_landed, has_landed < 1.0, LEAST, PAR)
        counts.append(law.missed)
    assert counts == pytest.approx([1.0, 2.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("has_landed", "share", "is_noisy", "late"),
    [
        (0.0, 0.0, False, True),
        (1.0, -1.0, False, False),
        (1.0, 0.39, False, False),
        (1.0, 0.41, False, True),
        (1.0, 0.59, True, False),
        (1.0, 0.61, True, True),
    ],
)
def test_late_is_what_comes_long_after_it_was_planned_or_never(has_landed, share, is_noisy, late):
    assert bool(laws.is_late(has_landed, share * FIRST.travel, FIRST.travel, is_noisy)) is late


def test_travel_gets_longer_but_not_for_ever():
    planned = PAR.closing_travel
    assert laws.stretch_travel(FIRST, planned) == laws.STRETCH * planned
    law = FIRST
    for _ in range(50):
        law = law._replace(travel=laws.stretch_travel(law, planned))
    assert law.travel == laws.LONGEST_TRAVEL * planned


def test_openings_that_come_late_twice_in_a_row_get_less_flux_linkage_near_their_stop_and_early_ones_no_more():
    """What one late opening says may be noise, and an early one may be an estimator that drifts."""
    once = laws.ease_opening(FIRST, True, 0.5e-3)
    assert not np.any(np.array(once.mean, float))
    twice = laws.ease_opening(once, True, 0.3e-3)
    assert twice.mean[0] == -twice.mean[1] == pytest.approx(-laws.EASED * 0.3e-3)
    early = laws.ease_opening(twice, True, -2e-3)
    assert early.mean[0] == pytest.approx(laws.REMEMBERED * twice.mean[0]) and early.late == 0.0
    floated = FIRST._replace(floated=1.0)  # by the current: an estimator that calls it early is wrong
    for _ in range(2):
        floated = laws.ease_opening(floated, True, -2e-3)
    assert floated.mean[0] == pytest.approx(-laws.EASED * laws.LATEST)
    law = FIRST
    for _ in range(40):
        law = laws.ease_opening(law, True, 9.0)
    assert law.mean[0] == -laws.EASIEST
    untold = laws.ease_opening(law, False, 9.0)
    assert untold.mean[0] == law.mean[0] and untold.late == 0.0
