"""Drawn values have the distribution that is asked for, fill the cube as their method promises, and never change."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gapsense.many.draws import DISTRIBUTIONS, METHODS, points

ORACLES = {  # of scipy.stats, which knows nothing of ours
    "uniform": ({"low": -2.0, "high": 3.0}, stats.uniform(-2.0, 5.0)),
    "loguniform": ({"low": 0.1, "high": 30.0}, stats.loguniform(0.1, 30.0)),
    "normal": ({"mean": 5.0, "std": 2.0}, stats.norm(5.0, 2.0)),
    "normal between limits": (
        {"mean": 5.0, "std": 2.0, "low": 4.0, "high": 10.0},
        stats.truncnorm(-0.5, 2.5, 5.0, 2.0),
    ),
    "lognormal": ({"median": 0.4, "sigma": 0.3}, stats.lognorm(0.3, scale=0.4)),
    "integer": ({"low": 3, "high": 7}, stats.randint(3, 8)),
}
EMPTY = dict.fromkeys(("low", "high", "mean", "std", "median", "sigma", "values"))


def drawn(name, own, u):
    return DISTRIBUTIONS[name.partition(" ")[0]].quantile(u, {**EMPTY, **own})


@pytest.mark.parametrize("name", ORACLES)
def test_quantiles_are_those_of_scipy(name):
    own, oracle = ORACLES[name]
    u = np.linspace(1e-6, 1.0 - 1e-6, 1001)
    assert drawn(name, own, u) == pytest.approx(oracle.ppf(u), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", ORACLES)
@pytest.mark.parametrize("method", METHODS)
def test_draws_follow_their_distribution(name, method):
    own, oracle = ORACLES[name]
    values = drawn(name, own, points(method, 1024, 2, 5)[:, 1])
    if name == "integer":
        assert stats.chisquare(np.bincount(values - 3, minlength=5)).pvalue > 1e-3
    else:
        assert stats.kstest(values, oracle.cdf).pvalue > 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_points_are_the_same_ones_for_ever_and_others_for_another_seed(method):
    one = points(method, 64, 3, 7)
    assert one.shape == (64, 3) and np.all((one > 0.0) & (one < 1.0))
    assert np.array_equal(points(method, 64, 3, 7), one)
    assert not np.any(points(method, 64, 3, 8) == one)


def test_latin_hypercube_has_one_point_in_every_layer():
    for column in points("latin-hypercube", 50, 4, 1).T:
        assert sorted(np.floor(50 * column).astype(int)) == list(range(50))


def test_sobol_points_are_balanced():
    u = points("sobol", 256, 2, 3)
    assert np.array_equal(np.histogram2d(*u.T, bins=16, range=[[0, 1], [0, 1]])[0], np.ones((16, 16)))


def test_choice_takes_every_value_as_often():
    values = drawn("choice", {"values": [1, "two", True]}, (np.arange(300) + 0.5) / 300)
    assert [type(values[k]) for k in (0, 100, 200)] == [int, str, bool]
    assert [list(values).count(v) for v in ("two",)] == [100]


LIMITS = st.floats(-1e6, 1e6).flatmap(lambda low: st.tuples(st.just(low), st.floats(low + 1e-3, low + 1e6)))
INSIDE = st.floats(2.0**-32, 1.0 - 2.0**-32)


@given(LIMITS, st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), INSIDE)
def test_what_is_drawn_lies_within_its_limits(limits, mean, std, u):
    low, high = limits
    own = {**EMPTY, "low": low, "high": high, "mean": mean, "std": std}
    slack = 1e-9 * (abs(low) + abs(high) + std)
    for name in ("uniform", "normal"):
        if not DISTRIBUTIONS[name].problem(own):
            value = float(DISTRIBUTIONS[name].quantile(np.array([u]), own)[0])
            assert math.isfinite(value) and low - slack <= value <= high + slack
