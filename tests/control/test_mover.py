"""The mover that a controller believes in: balance, and derivatives against differences."""

import math

import pytest
from commanded import parameters
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.control.learning import with_law
from gapsense.control.mover import (
    NUMBERS,
    balance,
    depth,
    force,
    gap_slopes,
    make_mover,
    move,
    squared_flux,
    squares,
    start_at_rest,
)

LAWS = st.tuples(*[st.floats(-0.3, 0.3)] * NUMBERS)
WITHIN = st.floats(0.45e-3, 1.35e-3)


def a_mover(law=(0.0,) * NUMBERS, **changed):
    return with_law(make_mover(parameters(**changed)), law)


@given(LAWS, WITHIN)
def test_balance_is_the_flux_linkage_without_acceleration(law, z):
    m = a_mover(law)
    B = balance(z, m)
    assert squared_flux(z, 0.0, 0.0, m) == pytest.approx(B)
    assert move(start_at_rest(z), B, 1e-5, m).velocity == pytest.approx(0.0, abs=1e-12)
    assert move(start_at_rest(z), 1.1 * B, 1e-5, m).velocity < 0.0 < move(start_at_rest(z), 0.9 * B, 1e-5, m).velocity


def test_balance_is_force_over_slope_of_the_gap():
    m = a_mover()
    z = 0.8e-3
    assert 0.5 * balance(z, m) * gap_slopes(z, m)[0] == pytest.approx(force(z, m))
    assert force(z, m) == pytest.approx(61.8 * (19.2e-3 - z))
    assert (depth(m.gap.largest, m), depth(m.gap.smallest, m)) == (0.0, 1.0)


@given(LAWS, WITHIN, st.floats(-1.0, 1.0), st.floats(-500.0, 500.0))
def test_flux_linkage_gives_the_acceleration_that_was_asked_for(law, z, v, a):
    m = a_mover(law)
    squared = squared_flux(z, v, a, m)
    assert (move(start_at_rest(z)._replace(velocity=v), squared, 1e-6, m).velocity - v) / 1e-6 == pytest.approx(
        a, abs=1e-5
    )


@settings(max_examples=15)
@given(LAWS, st.floats(0.7, 1.3), st.booleans())
def test_derivatives_are_those_of_the_motion(law, share, bends):
    """Also with a corrected gap, and where the motion leaves the stops."""
    changed = {"gap_factor": 1.05, "gap_bend": 1e7} if bends else {}

    def motion(law):
        m, at = a_mover(law, **changed), start_at_rest(0.9e-3)
        for k in range(120):
            at = move(at, share * 1.2e-4 * (1.0 + math.sin(0.05 * k)), 20e-6, m)
        return at

    at, h = motion(law), 1e-5
    for k in range(NUMBERS):
        more, less = (motion([x + sign * h * (i == k) for i, x in enumerate(law)]) for sign in (1, -1))
        assert at.by_position[k] == pytest.approx((more.position - less.position) / (2 * h), rel=2e-3, abs=2e-6)
        assert at.by_velocity[k] == pytest.approx((more.velocity - less.velocity) / (2 * h), rel=2e-3, abs=2e-3)


def test_two_samples_have_the_mean_of_their_squares():
    assert squares(1.0, 3.0) == 5.0
