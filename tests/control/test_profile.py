"""The path meets its ends, and its flux linkage moves the mover along it."""

import math

import pytest
from commanded import parameters
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.control.mover import balance, make_mover, move, squares, start_at_rest
from gapsense.control.profile import FROM, Deviation, Operation, _beside, arrival, flux, is_planned, path, stops

MOVER = make_mover(parameters())
PLANS = st.builds(
    Operation,
    is_closing=st.booleans(),
    lead=st.floats(0.5e-3, 2e-3),
    travel=st.floats(3e-3, 5e-3),
    tail=st.floats(1e-3, 4e-3),
    distance=st.floats(20e-6, 150e-6),
    speed=st.floats(0.06, 0.4),
    start=st.floats(0.0, 12e-3),
    deviation=st.just(Deviation()),
)
SHORT = 1e-7  # s


@given(PLANS)
def test_path_begins_at_rest_and_comes_near_the_stop_with_the_approach_speed(plan):
    z0, z1 = stops(plan.is_closing, MOVER)
    sign = math.copysign(1.0, z1 - z0)
    assert path(0.0, plan, MOVER) == pytest.approx((z0, 0.0, 0.0), abs=1e-12)
    at = path(plan.travel, plan, MOVER)
    assert at.position == pytest.approx(z1 - sign * plan.distance, abs=1e-9)
    assert (at.velocity, at.acceleration) == pytest.approx((sign * plan.speed, 0.0), abs=1e-6)


@given(PLANS)
def test_path_goes_on_with_its_speed_until_the_stop(plan):
    _, z1 = stops(plan.is_closing, MOVER)
    near, there = path(plan.travel, plan, MOVER), path(plan.travel + plan.distance / plan.speed, plan, MOVER)
    assert there.position == pytest.approx(z1, abs=1e-9)
    half = path(plan.travel + 0.5 * plan.distance / plan.speed, plan, MOVER)
    assert half.position == pytest.approx(0.5 * (near.position + z1), abs=1e-9)
    assert path(plan.travel + 1.0, plan, MOVER).position == pytest.approx(z1, rel=1e-12)


@given(PLANS, st.floats(0.01, 1.4))
def test_velocity_and_acceleration_are_derivatives(plan, share):
    tau = share * plan.travel
    if abs(share - 1.0) < 1e-3 or tau > plan.travel + plan.distance / plan.speed - 1e-5:
        return
    before, at, after = (path(tau + k * SHORT, plan, MOVER) for k in (-1, 0, 1))
    assert (after.position - before.position) / (2 * SHORT) == pytest.approx(at.velocity, abs=1e-5)
    assert (after.velocity - before.velocity) / (2 * SHORT) == pytest.approx(at.acceleration, abs=0.5)


@given(PLANS, st.floats(0.05, 0.6), st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.floats(0.01, 0.99))
def test_deviation_from_the_path_begins_where_the_mover_is_and_ends_with_the_travel(plan, since, off, share):
    deviation = Deviation(since * plan.travel, 50e-6 * off[0], 0.1 * off[1], 50.0 * off[2])
    plan = plan._replace(deviation=deviation)

    def beside(tau):
        on = path(tau, plan, MOVER)
        return [there - here for there, here in zip(_beside(on, tau, plan), on)]

    assert beside(deviation.since) == pytest.approx(list(deviation[1:]), abs=1e-12)
    assert beside(plan.travel) == pytest.approx([0.0] * 3, abs=1e-9)
    tau = deviation.since + share * (plan.travel - deviation.since)
    before, at, after = (beside(tau + k * SHORT) for k in (-1, 0, 1))
    assert (after[0] - before[0]) / (2 * SHORT) == pytest.approx(at[1], abs=1e-5)
    assert (after[1] - before[1]) / (2 * SHORT) == pytest.approx(at[2], abs=0.5)


@given(PLANS)
def test_flux_linkage_begins_where_it_is_and_reaches_the_balance_of_the_spring(plan):
    z0, _ = stops(plan.is_closing, MOVER)
    B = math.sqrt(balance(z0, MOVER))
    assert flux(0.0, plan, MOVER) == pytest.approx(plan.start)
    assert flux(plan.lead - 1e-12, plan, MOVER) == pytest.approx(B, rel=1e-6)
    assert flux(plan.lead, plan, MOVER) == pytest.approx(B, rel=1e-6)


@settings(max_examples=15)
@given(PLANS, st.floats(0.7, 1.3), st.floats(0.7, 1.3))
def test_flux_linkage_moves_the_mover_along_the_path(plan, stiffer, lighter):
    """Up to where it is biased, also a mover that was learnt."""
    m = MOVER._replace(balance=math.log(stiffer), lightness=math.log(lighter))
    plan = plan._replace(travel=max(plan.travel, 4e-3))
    z0, _ = stops(plan.is_closing, m)
    at, dt, tau = start_at_rest(z0), 5e-6, 0.0
    while tau < FROM * plan.travel - dt:
        old, new = (flux(plan.lead + t, plan, m) for t in (tau, tau + dt))
        if new <= 1.1e-3:
            return  # this mover cannot be that fast: no flux linkage accelerates the spring
        at, tau = move(at, squares(old, new), dt, m), tau + dt
    wanted = path(tau, plan, m)
    assert at.position == pytest.approx(wanted.position, abs=4e-6)
    assert at.velocity == pytest.approx(wanted.velocity, abs=0.02)


@pytest.mark.parametrize("is_closing", [True, False])
def test_who_is_late_is_pulled(is_closing):
    plan = Operation(is_closing, 1e-3, 3.4e-3, 3.5e-3, 80e-6, 0.1, 0.0)
    landing = plan.lead + arrival(plan)
    usual, late, later = (flux(landing + t, plan, MOVER) for t in (0.0, 1e-3, 2e-3))
    assert (usual < late < later) if is_closing else (usual > late > later)
    assert flux(landing + 5e-3, plan, MOVER) == flux(landing + 4e-3, plan, MOVER) > 0.0


def test_profile_ends_with_its_tail():
    plan = Operation(True, 1e-3, 3e-3, 2e-3, 80e-6, 0.1, 0.0)
    assert is_planned(5.9e-3, plan) and not is_planned(6.1e-3, plan)
