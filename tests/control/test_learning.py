"""Another mover than the believed one is found from when it took off and landed."""

import numpy as np
import pytest
from commanded import inputs, parameters

from gapsense.control import laws, learning, run_to_run
from gapsense.control.mover import NUMBERS, make_mover, move, squares, start_at_rest
from gapsense.control.profile import Operation, arrival, flux, stops
from gapsense.control.records import LONGEST, Heard
from gapsense.estimators.kalman import Gaussian
from gapsense.kernels.layout import blank

PAR = parameters()
DT = PAR.sample_time


def true_mover(law):
    return learning.with_law(make_mover(PAR), np.array(law))


def flown(plan, m):
    """Flux linkage of a slow profile and of a long hold, and the samples of take-off and landing."""
    z0, z1 = stops(plan.is_closing, m)
    fluxes = [flux(min(k * DT, plan.lead + arrival(plan) + 3e-3), plan, make_mover(PAR)) for k in range(490)]
    at, takeoff = start_at_rest(z0), 0.0
    for k in range(1, len(fluxes)):
        at = move(at, squares(fluxes[k - 1], fluxes[k]), DT, m)
        pushed = at.position > z0 if plan.is_closing else at.position < z0
        at, takeoff = (start_at_rest(z0), float(k)) if pushed and not takeoff > k else (at, takeoff)
        if (at.position - z1) * (z1 - z0) >= 0.0:
            return fluxes, takeoff + 1.0, float(k)
    return fluxes, takeoff + 1.0, 0.0


def learnt(law, half, operations=3):
    """The law after some operations, and how far from its stop a landing is computed, before and after."""
    state, _ = run_to_run.initial(inputs(), PAR)
    known = state.laws
    for kind in (half, 1.0 - half):
        known = laws.write(known, kind, laws.first(PAR.closing_travel, 0.0, PAR))
    plan = Operation(half > 0.5, 1.5e-3, 3.4e-3, 3.5e-3, 80e-6, 0.4, 0.0 if half > 0.5 else 20e-3)
    fluxes, takeoff, landing = flown(plan, true_mover(law))
    memory = np.zeros(2 * LONGEST)
    memory[round(half) * LONGEST :][: len(fluxes)] = fluxes
    state = state._replace(laws=known, fluxes=memory.tolist() if isinstance(state.fluxes, list) else memory)
    misses = []
    for _ in range(operations + 1):
        state = learning.begin_pass(
            state._replace(heard=blank(Heard, last_mode=3.0, began=1.0, takeoff=takeoff, landing=landing)),
            half,
            0.0,
            0.0,
            PAR,
        )
        while state.course.last >= state.course.at:
            last, state = state, learning.work(state, PAR)
        assert last.course.half == half
        misses.append(abs(state.course.motion[0] - stops(half > 0.5, true_mover(law))[1]))
    return laws.read(state.laws, half), misses, landing


@pytest.mark.parametrize(("half", "law"), [(1.0, (-0.1, 0.05, 0.1, 0.0)), (0.0, (0.08, -0.05, -0.1, 0.0))])
def test_computed_landing_comes_to_the_stop(half, law):
    _, misses, landing = learnt(law, half)
    assert landing > 0.0 and misses[0] > 30e-6
    assert misses[-1] < 0.3 * misses[0]


def test_believed_mover_changes_nothing():
    law, misses, landing = learnt((0.0,) * NUMBERS, 1.0, operations=0)
    assert landing > 0.0 and misses[0] < 8e-6
    assert np.abs(law.mean).max() < 0.03


def test_balance_at_the_take_off_is_found(a=-0.15):
    law, _, landing = learnt((a, 0.0, 0.0, 0.0), 1.0, operations=1)
    assert landing > 0.0 and law.mean[0] == pytest.approx(a, abs=0.05)
    assert law.cov[0, 0] < 0.25 * laws.BEFORE[0] ** 2


@pytest.mark.parametrize(("half", "sign"), [(1.0, 1.0), (0.0, -1.0)])
def test_mover_that_stays_is_believed_to_need_more_to_leave(half, sign):
    """More pull at a closing; at an opening less."""
    state, _ = run_to_run.initial(inputs(), PAR)
    state = state._replace(laws=laws.write(state.laws, half, laws.first(PAR.closing_travel, 0.0, PAR)))
    state = learning.begin_pass(state._replace(heard=blank(Heard, last_mode=3.0, began=1.0)), half, 0.0, 0.0, PAR)
    assert laws.read(state.laws, half).mean[0] == pytest.approx(sign * learning.STUCK)
    assert state.course.last < state.course.at  # and there is nothing to compute


def test_nothing_is_learnt_where_the_contact_was_not_heard():
    state, _ = run_to_run.initial(inputs(), PAR)
    state = state._replace(laws=laws.write(state.laws, 1.0, laws.first(PAR.closing_travel, 0.0, PAR)))
    state = learning.begin_pass(state._replace(heard=blank(Heard)), 1.0, 0.0, 0.0, PAR)
    assert not laws.read(state.laws, 1.0).mean.any() and state.course.last < state.course.at


def test_slopes_of_soft_landings_are_steady_and_those_of_an_ordinary_one_are_not_kept():
    known, one, other = laws.first(3.4e-3, 0.0, PAR), [1.0, 2.0, 3.0, 4.0], [3.0, 2.0, 5.0, 4.0]
    first = learning._steady(known, one, 0.05)
    assert [*first] == one  # the first one
    soft = known._replace(slopes=first, was_plain=0.0)
    assert [*learning._steady(soft, other, 0.05)] == pytest.approx([1.1, 2.0, 3.1, 4.0])
    assert [*learning._steady(soft._replace(was_plain=1.0), other, 0.05)] == other
    state, _, _ = learnt((0.0,) * NUMBERS, 1.0)  # all of them ordinary ones, as far as the law knows
    assert not np.any(np.array(state.slopes, float))


def test_other_damping_is_found_by_approaches_of_different_speed():
    """What `a`, `b` and `q` cannot be: a mover that is held back while it is fast, and not where it is slow."""
    state, _ = run_to_run.initial(inputs(), PAR)
    law = laws.forget(laws.first(PAR.closing_travel, 0.0, PAR), 0.0, PAR)
    known = laws.write(state.laws, 1.0, law)
    known = laws.write(known, 0.0, law._replace(cov=1e6 * np.identity(NUMBERS)))  # nothing is known of openings
    state, true = state._replace(laws=known), true_mover((0.0, 0.0, 0.0, 0.5))
    for speed in 3 * [0.4, 0.25, 0.15, 0.08]:
        plan = Operation(1.0, 1.5e-3, 3.4e-3, 3.5e-3, 80e-6, speed, 0.0)
        fluxes, takeoff, landing = flown(plan, true)
        memory = np.zeros(2 * LONGEST)
        memory[LONGEST:][: len(fluxes)] = fluxes
        heard = blank(Heard, last_mode=3.0, began=1.0, takeoff=takeoff, landing=landing)
        state = learning.begin_pass(state._replace(fluxes=memory, heard=heard), 1.0, 0.0, 0.0, PAR)
        while state.course.last >= state.course.at:
            state = learning.work(state, PAR)
    law = laws.read(state.laws, 1.0)
    assert landing > 0.0 and law.mean[3] > 0.25
    assert abs(state.course.motion[0] - PAR.stop_lower) < 50e-6


def test_change_in_each_operation_is_expected_again():
    """Landings that are early again and again, by as much: what is learnt runs ahead; not after an ordinary one."""
    law, told = laws.first(3.4e-3, 0.0, PAR), (np.array([-0.05]), np.eye(NUMBERS)[:1], np.array([0.1]))
    steady, still, other = law, law, Gaussian(law.mean, law.cov)
    for _ in range(5):
        steady = learning._learnt(steady, other, told, 10.0, learning.TREND, np.ones(4))
        still = learning._learnt(still, other, told, 10.0, 0.0, np.ones(4))
    assert steady.trend[0] < 0.0 and not np.any(np.array(still.trend, float))
    assert steady.mean[0] < still.mean[0] < 0.0
    assert not np.any(np.array(laws.forget(steady, 0.0, PAR).trend, float))


def test_what_no_landing_tells_is_drawn_towards_the_other_kind_of_operation():
    own, other = (Gaussian(np.array(mean), 0.01 * np.identity(NUMBERS)) for mean in ((0.3, 0.0, -0.5, 0.05), [0.0] * 4))
    near, nearer = (learning.draw_near(own, other, within) for within in (1.0, 0.2))
    assert near.mean[[1, 3]].tolist() == [0.0, 0.05]  # as near as the core explains
    assert 0.1 < near.mean[0] < 0.28 and -0.45 < near.mean[2] < -0.1
    assert nearer.mean[3] < 0.05 and abs(nearer.mean[2]) < abs(near.mean[2])  # what a late landing tells is less
    assert np.allclose(learning.draw_near(own, other, 100.0).mean, own.mean, rtol=0.0, atol=0.0)
