"""The current tells how hard a stop was hit, and when, where a contact tells nothing or too late."""

import numpy as np
import pytest
from commanded import inputs, parameters

from gapsense.control import bend, laws, run_to_run
from gapsense.control.judging import (
    FELT,
    _judge_landing,
    _slowest,
    _speed_by_time,
    judged_by_contact,
    judged_by_current,
    note_contact,
)
from gapsense.control.mover import make_mover
from gapsense.control.profile import arrival, stops
from gapsense.control.records import CLOSING, LONGEST, OPENING, Heard
from gapsense.estimators.mhe.model import gap, make_gap
from gapsense.kernels.layout import blank

PAR = parameters()
FLUX, LANDING, AGE = 0.011, 240.0, 400.0
PIECE = bend.piece(0.0, PAR)
GROWTH = 4e3  # of the reluctance by the flux linkage in a core that saturates [1/(H Wb)]


def hit(half, speed, landing=LANDING, fluxes=FLUX, growth=0.0):
    """A state whose memory has an operation that ends at its stop with a speed.

    Its flux linkage is constant, or of each sample; the reluctance of the core may grow with that.
    """
    state, _ = run_to_run.initial(inputs(), PAR)
    _, z1 = stops(half > 0.5, make_mover(PAR))
    sign = -1.0 if half > 0.5 else 1.0
    positions = [z1 + sign * speed * min(0.0, (k - landing + 0.5) * PAR.sample_time) for k in range(LONGEST)]
    gaps = np.array([gap(z, make_gap(PAR), PAR.gap_factor, PAR.gap_bend)[0] for z in positions])
    currents = fluxes * (gaps + growth * (fluxes - np.min(fluxes)))
    charges = np.concatenate([[0.0], np.cumsum(0.5 * np.add(currents[1:], currents[:-1]))]) * PAR.sample_time
    memory = {name: np.zeros(2 * LONGEST) for name in ("fluxes", "charges")}
    memory["fluxes"][round(half) * LONGEST :][:LONGEST] = fluxes
    memory["charges"][round(half) * LONGEST :][:LONGEST] = charges
    known = state.laws
    for each, travel in ((CLOSING, PAR.closing_travel), (OPENING, PAR.opening_travel)):
        law = laws.first(travel, 0.0, PAR)._replace(was_plain=0.0, speed=PAR.approach_least, length=AGE)
        known = laws.write(known, each, law)
    running = state.running._replace(command=half, age=AGE, is_plain=0.0, speed=PAR.approach_least)
    return state._replace(**memory, laws=known, running=running)


@pytest.mark.parametrize("half", [CLOSING, OPENING])
@pytest.mark.parametrize("speed", [0.05, 0.1, 0.5])
def test_bend_of_the_current_is_the_speed(half, speed):
    found, noise = bend.speed_at(hit(half, speed), half, LANDING, PIECE, PAR)
    assert found == pytest.approx(speed, rel=0.1) and 0.0 < noise < 0.1


@pytest.mark.parametrize("landing", [0.0, 10.0, AGE - 5.0, 1023.0])
def test_pieces_that_were_not_kept_tell_nothing(landing):
    assert bend.speed_at(hit(CLOSING, 0.5, landing), CLOSING, landing, PIECE, PAR) == (0.0, bend.UNKNOWN)


def watched(state, contact):
    """Every sample, until the operation has ended."""
    state = state._replace(heard=blank(Heard, last_mode=2.0, began=1.0, takeoff=80.0))
    for k in range(81, round(AGE)):
        landing = contact if k >= contact > 0.0 else 0.0
        heard = state.heard._replace(landing=landing)
        state = state._replace(heard=heard, running=state.running._replace(age=float(k)))
        state = state._replace(heard=bend.find_hardest_bend(state, PAR))
    return judged_by_current(judged_by_contact(state, PAR), PAR)


def test_soft_landing_is_nothing_to_note():
    state = watched(hit(CLOSING, 0.1), LANDING)
    assert state.heard.hit == 0.0 and state.heard.landing == LANDING
    assert state.alarm == 0.0 and max(state.noted) == 0.0


@pytest.mark.parametrize("half", [CLOSING, OPENING])
def test_hard_landing_makes_the_next_operations_ordinary_and_what_was_learnt_a_guess(half):
    state = watched(hit(half, 0.6), LANDING)
    assert state.noted.hard == state.noted.changed == 1.0
    assert state.alarm == 1.0 + half  # a whole cycle, and an opening before that
    for each in (CLOSING, OPENING):
        law = laws.read(state.laws, each)
        assert np.array(law.cov) == pytest.approx(np.diag(np.square(laws.DOUBTED)))
        assert law.speed == PAR.approach_first


def test_stop_that_is_left_at_once_is_told_by_the_current():
    """A contact that tells nothing before the mover comes back."""
    state = watched(hit(CLOSING, 0.9, 220.0), 350.0)
    assert state.heard.landing == pytest.approx(220.0, abs=5) and state.noted.hard == 1.0


@pytest.mark.parametrize(("offset", "landing"), [(0.0, 220.0), (60e-6, 290.0)])
def test_faint_hit_teaches_where_the_reluctance_shows_the_mover_at_its_stop(offset, landing):
    """It is no alarm; a bend as large some way off the stop is none. The flux linkage rises once it is seated."""
    fluxes = FLUX + 2e-5 * np.maximum(0.0, np.arange(LONGEST) - 250.0)
    state = hit(CLOSING, 0.5, 220.0, fluxes)
    away = np.where(np.arange(LONGEST) < 260, offset, 0.0) * bend.gap_slopes(PAR.stop_lower, make_mover(PAR))[0]
    state.charges[LONGEST:][:LONGEST] += np.cumsum(fluxes * away) * PAR.sample_time
    due = bend.due(bend.running_plan(state.running, PAR), PAR)
    state = watched(state._replace(running=state.running._replace(due=due)), 290.0)
    assert state.heard.landing == pytest.approx(landing, abs=5)
    assert state.alarm == state.noted.changed == state.noted.hard == 0.0


def noisy(state):
    """With 20 mA, and their pieces."""
    noise = 20e-3
    running = state.running._replace(averaged=9.0, piece=bend.piece(noise, PAR))
    return state._replace(coil=state.coil._replace(noise=noise), running=running)


def test_pieces_are_longer_with_noise_so_that_a_stop_that_is_left_at_once_is_told():
    """Before, noise explained all up to 2 m/s."""
    state = noisy(hit(CLOSING, 1.2, 220.0))
    assert 2.0 * bend.PIECE < state.running.piece * PAR.sample_time < 3.0 * bend.PIECE
    assert bend.speed_at(state, CLOSING, 220.0, state.running.piece, PAR)[1] < 0.1
    told, soft = watched(state, 350.0), watched(noisy(hit(CLOSING, 0.3, 220.0)), 350.0)
    assert told.heard.landing == pytest.approx(220.0, abs=15) and told.noted.hard == told.noted.changed == 1.0
    assert soft.heard.hit == soft.noted.hard == 0.0


@pytest.mark.parametrize("half", [CLOSING, OPENING])
def test_time_of_a_contact_tells_hard_landings_that_are_early_or_much_too_late(half):
    """What noise hides in the current; a landing in time says nothing, and one that is a little late neither."""
    state = noisy(hit(half, 0.1))
    due = bend.due(bend.running_plan(state.running, PAR), PAR) - round(bend.SEATED / PAR.sample_time)

    def timed(late):
        landing = due + round(late / PAR.sample_time)
        return _speed_by_time(state._replace(heard=state.heard._replace(landing=landing)), PAR)

    assert timed(-2e-3) > 0.4 and timed(2.4e-3) == pytest.approx(0.5)
    assert all(timed(late) < 0.2 for late in (-1e-3, 0.0, 2.2e-3)) and timed(-due * PAR.sample_time) == 0.0
    heard = state.heard._replace(landing=due + 2.4e-3 / PAR.sample_time)
    late = judged_by_current(state._replace(heard=heard), PAR)
    assert late.noted.hard == late.noted.changed == 1.0


def test_bend_of_a_core_that_saturates_is_no_hit():
    """Where the flux linkage stops falling, its reluctance does too; the contact comes 1.3 ms later, softly."""
    since = (np.arange(LONGEST) - 225.0) * PAR.sample_time
    fluxes = np.clip(0.01 + np.where(since < 0.0, -2.0, 3.5) * since, 0.0, 0.016)
    state = hit(CLOSING, 0.08, 290.0, fluxes, 2500.0)
    due = bend.due(bend.running_plan(state.running, PAR), PAR)
    state = watched(state._replace(running=state.running._replace(due=due)), 290.0)
    assert bend._impact(state, 225.0, PAR)[0] > 0.5
    assert state.heard.landing == 290.0 and state.heard.hit == 0.0
    assert max(state.noted) == state.alarm == 0.0


def whole(state):
    """An operation that has lasted longer than its plan, without a contact; an opening, after a closing."""
    plan = bend.running_plan(state.running, PAR)
    if state.running.command == OPENING:
        state.fluxes[LONGEST:] = state.fluxes[LONGEST - 1]
        state.charges[LONGEST:] = 1.12 * state.charges[LONGEST - 1] / (LONGEST - 1.0) * np.arange(LONGEST)
    return state._replace(
        running=state.running._replace(age=490.0, due=bend.due(plan, PAR), held=bend.held(plan, PAR)), by_model=1.0
    )


@pytest.mark.parametrize("half", [CLOSING, OPENING])
def test_current_tells_whether_an_operation_has_arrived(half):
    """Also one that stays where it was; not one that ends before its plan."""
    ended = whole(hit(half, 0.1, 200.0))
    stays = hit(1.0 - half, 0.1, 1.0)
    stayed = np.where(np.arange(2 * LONGEST) // LONGEST == half, np.roll(stays.charges, LONGEST), ended.charges)
    stays = ended._replace(charges=stayed)
    is_there, is_absent, seated = bend.tell_arrival(ended, 0.0, PAR)
    assert (is_there, is_absent) == (half == CLOSING, False) and seated > 0.0
    assert not bend.tell_arrival(stays, 0.0, PAR)[0]
    assert bend.tell_arrival(stays, seated, PAR) == (False, True, seated)
    cut = ended._replace(running=ended.running._replace(age=200.0))
    assert bend.tell_arrival(cut, seated, PAR) == (False, False, seated)
    dead = ended._replace(fluxes=0.1 * ended.fluxes)  # no voltage has come: nothing holds a mover
    assert bend.tell_arrival(dead, seated, PAR)[:2] == (False, half == CLOSING)


def test_mover_that_floats_near_its_stop_is_told_by_the_reluctance_of_earlier_landings():
    """It has 0.26 mm to go, and lands with the voltage that holds: no bound of the nominal actuator tells that."""
    state = whole(hit(CLOSING, 0.1, 200.0))
    _, _, seated = bend.tell_arrival(state, 0.0, PAR)
    floating = whole(hit(CLOSING, 0.1, 200.0 + 0.26e-3 / 0.1 / PAR.sample_time))
    half = slice(LONGEST, 2 * LONGEST)
    z = 0.26e-3 + stops(True, make_mover(PAR))[1]
    current = FLUX * gap(z, make_gap(PAR), PAR.gap_factor, PAR.gap_bend)[0]
    floating.charges[half] = current * PAR.sample_time * np.arange(LONGEST)
    assert not bend.tell_arrival(floating, 0.0, PAR)[1]
    assert bend.tell_arrival(floating, seated, PAR)[1]
    for law in (0.0, 1.0):  # a contact that is only heard after the plan denies nothing
        known = laws.write(floating.laws, CLOSING, laws.read(floating.laws, CLOSING)._replace(seated=seated))
        heard = blank(Heard, last_mode=2.0, began=1.0, takeoff=80.0, landing=480.0 * (1.0 - law))
        judged = judged_by_current(floating._replace(laws=known, by_model=law, heard=heard), PAR)
        assert judged.noted.changed == 1.0 and judged.alarm == 2.0


def floating(half, faster, noise=2e-3):
    """An operation whose mover gets faster by so much in a millisecond, from its planned arrival on."""
    state = whole(hit(half, 0.1, 200.0))
    m, plan = make_mover(PAR), bend.running_plan(state.running, PAR)
    late = np.maximum(np.arange(LONGEST) * PAR.sample_time - plan.lead - arrival(plan), 0.0)
    off = np.maximum(0.2e-3 - 0.5e3 * faster * late**2, 0.0)
    positions = stops(half > 0.5, m)[1] + (off if half > 0.5 else -off)
    currents = [FLUX * gap(z, make_gap(PAR), PAR.gap_factor, PAR.gap_bend)[0] for z in positions]
    own = slice(round(half) * LONGEST, (round(half) + 1) * LONGEST)
    state.charges[own] = np.cumsum(currents) * PAR.sample_time
    return state._replace(coil=state.coil._replace(noise=noise))


@pytest.mark.parametrize("half", [CLOSING, OPENING])
def test_a_mover_that_gets_faster_after_its_planned_arrival_has_floated(half):
    """It lands more than a millisecond late, whatever an estimator says; noise may hide it."""
    assert bend.has_floated(floating(half, 0.14), PAR)
    assert not bend.has_floated(floating(half, 0.14, noise=20e-3), PAR)
    for landing in (200.0, 300.0, 330.0):
        assert not bend.has_floated(whole(hit(half, 0.08, landing)), PAR)


def test_a_closing_that_has_floated_makes_the_next_approach_faster_whatever_an_estimator_says():
    """Before, one that the estimator took for landed in time, or did not explain, left it as slow as it was."""
    ended = judged_by_current(floating(CLOSING, 0.14), PAR)
    law = laws.read(ended.laws, CLOSING)
    assert law.speed > PAR.approach_least and law.missed == 0.0
    again = _judge_landing(ended, CLOSING, 1.0, 240.0 * PAR.sample_time, PAR)
    assert laws.read(again.laws, CLOSING).speed == law.speed and again.fell == 1.0
    soft = judged_by_current(whole(hit(CLOSING, 0.08, 300.0)), PAR)
    assert laws.read(soft.laws, CLOSING).speed == PAR.approach_least
    heard = judged_by_current(floating(CLOSING, 0.14)._replace(by_model=0.0), PAR)
    assert laws.read(heard.laws, CLOSING).floated == 0.0


def near(way, noise=2e-3):
    """A closing that has stayed so far from its stop, after some that have arrived."""
    _, _, seated = bend.tell_arrival(whole(hit(CLOSING, 0.1, 200.0)), 0.0, PAR)
    z = way + stops(True, make_mover(PAR))[1]
    state = whole(hit(CLOSING, 0.1, 200.0))
    current = FLUX * gap(z, make_gap(PAR), PAR.gap_factor, PAR.gap_bend)[0]
    state.charges[LONGEST:] = current * PAR.sample_time * np.arange(LONGEST)
    law = laws.read(state.laws, CLOSING)._replace(seated=seated, missed=laws.UNJUDGED)
    return state._replace(laws=laws.write(state.laws, CLOSING, law), coil=state.coil._replace(noise=noise))


def test_mover_that_floats_just_off_its_stop_is_told_unless_noise_may_be_that():
    """A warm coil with no voltage to spare: 0.1 mm short of the stop, and the estimator is late."""
    judged = judged_by_current(near(0.1e-3), PAR)
    assert judged.noted.changed == 1.0 and judged.alarm == 2.0
    assert judged_by_current(near(0.1e-3, noise=20e-3), PAR).alarm == 0.0


def held(way, noise=20e-3, wrong=1.0):
    """A closing that has stayed so far from its stop until its plan has ended, with a wrong flux linkage."""
    state = near(0.0, noise)
    z = np.where(np.arange(LONGEST) < 430, way, 0.0) + stops(True, make_mover(PAR))[1]
    reluctances = np.array([gap(each, make_gap(PAR), PAR.gap_factor, PAR.gap_bend)[0] for each in z])
    state.charges[LONGEST:] = np.cumsum(FLUX * reluctances) * PAR.sample_time
    return state._replace(by_model=1.0, fluxes=wrong * state.fluxes)


def test_noise_hides_no_mover_that_floats_until_its_plan_ends():
    """What the flux linkage is wrong by is in the reluctance of the seated mover too, from which it is told."""
    _, rested, _ = bend.tell_afloat(held(0.0), 0.0, PAR)
    assert rested > 0.0 and bend.tell_afloat(held(0.0), rested, PAR) == (0.0, rested, False)
    assert bend.tell_afloat(held(0.1e-3, noise=2e-3), rested, PAR) == (0.0, rested, False)
    for way, alarm, is_faster in ((0.0, 0.0, False), (0.06e-3, 0.0, True), (0.1e-3, 2.0, True)):
        state = held(way, wrong=1.03)
        law = laws.read(state.laws, CLOSING)._replace(rested=rested, was_followed=1.0)
        judged = judged_by_current(state._replace(laws=laws.write(state.laws, CLOSING, law)), PAR)
        assert judged.alarm == alarm and laws.read(judged.laws, CLOSING).floated == is_faster


@pytest.mark.parametrize(("way", "grows", "alarm"), [(0.8e-3, 0.9, 2.0), (0.0, 0.9, 0.0), (0.0, 0.0, 0.0)])
def test_first_closing_that_floats_is_told_although_there_is_none_to_compare_it_with(way, grows, alarm):
    """Held with 1.2 times the flux linkage a core has more reluctance; a core that does not saturate has the same."""
    state, late = held(way), np.arange(LONGEST) >= 430
    share = np.where(late, 1.2, 1.0)
    state.fluxes[LONGEST:] *= share
    steps = np.diff(state.charges[LONGEST:], prepend=0.0) * share * np.where(late, 1.0 + 0.2 * grows, 1.0)
    state.charges[LONGEST:] = np.cumsum(steps)
    law = laws.read(state.laws, CLOSING)._replace(seated=0.0, rested=0.0, was_followed=1.0)
    state = state._replace(laws=laws.write(state.laws, CLOSING, law))
    assert judged_by_current(state, PAR).alarm == alarm


def test_slowest_approaches_are_as_fast_as_what_noise_adds():
    quiet, noisy = (_slowest(near(0.0, noise), PAR) for noise in (10e-3, 20e-3))
    assert quiet == PAR.approach_least and noisy == pytest.approx(1.5 * quiet, rel=0.05)


@pytest.mark.parametrize(("way", "missed"), [(0.0, laws.UNJUDGED - FELT), (0.02e-3, laws.UNJUDGED)])
def test_only_a_closing_that_is_seated_as_earlier_ones_is_felt(way, missed):
    """Else the next one is ordinary, until an estimator has judged this one."""
    judged = judged_by_current(near(way), PAR)
    assert laws.read(judged.laws, CLOSING).missed == missed and judged.alarm == 0.0


def test_reluctance_of_a_seated_mover_follows_what_is_nearer_at_once_and_what_is_farther_slowly():
    state = whole(hit(CLOSING, 0.1, 200.0))
    _, _, seated = bend.tell_arrival(state, 0.0, PAR)
    assert bend.tell_arrival(state, 1.5 * seated, PAR)[2] == seated
    assert bend.tell_arrival(state, 0.9 * seated, PAR)[2] == pytest.approx(0.91 * seated)


@pytest.mark.parametrize("noise", [2e-3, 20e-3])
def test_opening_that_stops_shorter_each_time_is_told(noise):
    """By 1 % of the reluctance: that of a seated mover must not go with it. Noise is no excuse."""
    state = whole(hit(OPENING, 0.1, 200.0))
    state = state._replace(coil=state.coil._replace(noise=noise))
    _, _, seated = bend.tell_arrival(state, 0.0, PAR)
    told = []
    for short in np.arange(0.0, 0.25, 0.01):
        charges = np.where(np.arange(2 * LONGEST) < LONGEST, 1.0 - short, 1.0) * state.charges
        _, is_absent, seated = bend.tell_arrival(state._replace(charges=charges), seated, PAR)
        told.append(is_absent)
    assert not any(told[:10]) and all(told[15:])


def test_opening_that_floats_from_the_first_one_on_is_told():
    """It is compared with the open stop that the closing before has left, and not with openings that floated too."""
    state = whole(hit(OPENING, 0.1, 200.0))
    state.charges[:LONGEST] *= 0.8
    averaged = state._replace(running=state.running._replace(averaged=1.0))  # a current that is that of others too
    assert bend.tell_arrival(state, 0.0, PAR)[1] and not bend.tell_arrival(averaged, 0.0, PAR)[1]


def test_bend_where_hardly_any_flux_linkage_is_left_is_no_hit():
    """The voltage ends there, and current over flux linkage is noise."""
    state = hit(OPENING, 0.9)
    for balance_flux, is_hit in ((1.5 * FLUX, True), (2.5 * FLUX, False)):
        told = state._replace(running=state.running._replace(balance_flux=balance_flux))
        assert (watched(told, 0.0).heard.hit > 0.0) == is_hit


def test_contact_long_after_a_hit_is_a_second_landing():
    """Though in time: the mover was pushed back from its stop between two samples."""
    state = watched(hit(CLOSING, 0.75, 220.0), 262.0)
    assert state.heard.landing == pytest.approx(220.0, abs=5) and state.noted.changed == 1.0


def felt(half, landing, missed):
    """An operation by the law `model` that no estimator has explained, judged by the current; what is missed before."""
    state = whole(hit(half, 0.1, landing))
    law = laws.read(state.laws, half)._replace(missed=missed)
    return judged_by_current(state._replace(laws=laws.write(state.laws, half, law)), PAR)


def missed(state, half):
    return laws.read(state.laws, half).missed


def test_closing_without_an_estimator_in_time_counts_as_arrived_only_if_it_has():
    """By the law `model`: one that has is no reason for an ordinary cycle; after one that has not one comes at once."""
    for landing, alarm, is_due in ((200.0, 0.0, False), (800.0, 2.0, True)):
        judged = felt(CLOSING, landing, laws.UNJUDGED)
        assert judged.alarm == alarm and (missed(judged, CLOSING) >= laws.UNJUDGED) == is_due


def test_second_closing_in_a_row_that_no_estimator_explains_is_followed_by_an_ordinary_one():
    """However well the current tells that it has arrived; it does not tell how hard."""
    first = missed(felt(CLOSING, 200.0, laws.UNJUDGED), CLOSING)
    assert first < laws.UNJUDGED <= missed(felt(CLOSING, 200.0, first + laws.UNJUDGED), CLOSING)


def test_opening_counts_as_arrived_only_if_an_estimator_says_so():
    """An offset of the current looks like a gap that is open."""
    assert missed(felt(OPENING, 200.0, laws.UNJUDGED), OPENING) == laws.UNJUDGED


def test_a_first_approach_that_lands_in_a_saturated_core_is_not_hard():
    """Its flux linkage bends where it lands, as the profile goes on; the reluctance grows with it from then on."""
    samples = np.arange(LONGEST) - LANDING
    fluxes = FLUX + np.where(samples > 0.0, 5e-5, 2e-5) * samples
    state = hit(CLOSING, 0.4, fluxes=fluxes, growth=GROWTH)
    running = state.running._replace(due=LANDING + 30.0, speed=PAR.approach_first)
    state = state._replace(running=running, heard=blank(Heard, last_mode=1.0, began=1.0, takeoff=80.0, landing=LANDING))
    first, slower = (
        bend.landing_speed(state._replace(running=running._replace(speed=speed)), PAR)
        for speed in (PAR.approach_first, 0.9 * PAR.approach_first)
    )
    assert first == pytest.approx(0.4, abs=0.15) and slower > first + bend.SATURATED


def timed(contact, landing=LANDING, speed=1.1, noise=0.0, takeoff=80.0):
    """An ordinary closing whose contact tells the take-off and the landing at these samples."""
    state = hit(CLOSING, speed, landing)
    coil = state.coil._replace(noise=noise)
    running = state.running._replace(is_plain=1.0, piece=PIECE)
    state = state._replace(coil=coil, running=running, heard=blank(Heard, last_mode=3.0, began=1.0))
    for k in range(60, round(AGE)):
        mode = 3.0 if k < takeoff else 2.0 if k < contact else 1.0
        state = state._replace(running=state.running._replace(age=float(k)))
        state = bend.locate_bend(state._replace(heard=note_contact(state, inputs(mode=mode), PAR)), PAR)
    return state


@pytest.mark.parametrize("late", [0, 2, 5, 8])
def test_a_contact_that_is_late_in_an_ordinary_closing_is_taken_to_be_earlier_by_that(late):
    """100 us are 5 samples; what a prompt one may seem to be late by is none."""
    state = timed(LANDING + late, takeoff=80.0 + late)
    expected = late if late > 3 else 0
    assert state.late == pytest.approx(expected, abs=1) and (state.late == 0.0) == (expected == 0)
    assert state.heard.landing == LANDING + late - state.late
    assert state.heard.takeoff == 80.0 + late - state.late
    opening = state.running._replace(command=OPENING, age=150.0)
    state = state._replace(running=opening, heard=blank(Heard, last_mode=2.0, takeoff=90.0, taken=state.late))
    assert note_contact(state, inputs(mode=3.0), PAR).landing == 150.0 - state.late


@pytest.mark.parametrize(("given", "why"), [({"noise": 20e-3}, "noise"), ({"speed": 0.2}, "faint"), ({}, "bounce")])
def test_what_does_not_tell_a_contact_late_leaves_it_prompt(given, why):
    """A noisy current, a bend that is faint, and a contact so long after the bend that the mover has bounced."""
    state = timed(LANDING + (15.0 if why == "bounce" else 5.0), **given)
    assert state.late == state.contact_late == 0.0 and state.heard.landing > LANDING


def test_a_delay_from_before_the_noise_was_known_is_dropped():
    """The first closing lands before its noise is known; from then on the contact counts as it is."""
    state = timed(LANDING + 5.0, takeoff=85.0)
    assert state.late > 0.0 and state.heard.landing < LANDING + 5.0
    noisy = state._replace(coil=state.coil._replace(noise=20e-3))
    heard = note_contact(noisy, inputs(mode=1.0), PAR)
    assert (heard.takeoff, heard.landing) == (85.0, LANDING + 5.0)
