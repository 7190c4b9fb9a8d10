"""Runge-Kutta steps and crossings on problems with known answers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gapsense.kernels.integrate import CLOSENESS, crossing, equal_parts, next_part, rk4, rk4_until


def oscillation(count):
    """Error of position and of the mean kinetic energy of an oscillator after one radian, in `count` steps."""
    y, work = (1.0, 0.0), 0.0
    for _ in range(count):
        y, (part,) = rk4(lambda z: ((z[1], -z[0]), (z[1] * z[1],)), y, 1.0 / count)
        work += part
    return abs(y[0] - math.cos(1.0)), abs(work - (0.5 - 0.25 * math.sin(2.0)))


def test_states_and_integrals_have_order_four():
    errors = np.array([oscillation(n) for n in (8, 16, 32)])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(4.0, abs=0.2)


@given(st.floats(1e-6, 1.0), st.sampled_from([1.0, 2.0]))
def test_crossing_is_just_beyond_the_root(root, power):
    def value(s):
        return math.copysign(abs(root - s) ** power, root - s)

    length = crossing(value, 1.0, value(0.0), value(1.0)) if value(1.0) < 0.0 else 1.0
    assert value(length) < 0.0 or root == 1.0
    assert length - root <= 2 * CLOSENESS


def test_crossing_takes_few_trials():
    trials = []

    def value(s):
        trials.append(s)
        return math.cos(s) - 0.9

    crossing(value, 1.0, value(0.0), value(1.0))
    assert len(trials) < 15


def test_crossing_that_starts_at_zero_is_found_later():
    assert crossing(lambda s: s * (0.3 - s), 1.0, 0.0, -0.7) == pytest.approx(0.3)


def test_crossing_that_is_over_at_the_start_has_no_length():
    assert crossing(lambda s: -1.0, 1.0, -1.0, -1.0) == 0.0


@given(st.floats(0.02, 0.98))
def test_step_ends_where_its_margin_becomes_negative(height):
    """A stone dropped from `height` reaches the floor within the step."""

    def rate(y):
        return (y[1], -2.0), (y[1],)

    length, (h, v), (fallen,), has_landed = rk4_until(rate, (height, 0.0), 1.0, lambda y: y[0])
    assert has_landed and length == pytest.approx(math.sqrt(height), abs=1e-9)
    assert -1e-9 < h <= 0.0 and v == pytest.approx(-2.0 * length)
    assert fallen == pytest.approx(-height)
    passed_by = rk4_until(rate, (height, 0.0), 1.0, lambda y: y[0], False)
    assert (passed_by[0], passed_by[3]) == (1.0, False)
    assert rk4_until(rate, (height, 0.0), 0.1, lambda y: y[0] - 2.0)[0] == 0.0


@given(st.floats(1e-6, 1.0), st.floats(1e-3, 1.0))
def test_equal_parts_make_up_the_step(dt, longest):
    left, part, count = dt, equal_parts(dt, longest), 0
    assert part <= longest * 1.000001
    while left > 0.0:
        left, count = left - next_part(left, part), count + 1
    assert count == max(1, math.ceil(dt / longest - 1e-6))
    assert equal_parts(0.0, longest) == 0.0
