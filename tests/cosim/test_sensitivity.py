"""Signals in which small changes grow beyond the tolerance of the baseline are found, others are not."""

import math
from dataclasses import replace

import pytest

from gapsense.cosim import load, prepare, sensitivity
from gapsense.cosim.sensitivity import perturb, perturb_value

STATED = '[baseline]\nrtol = 1e-6\nsignals = ["*.y"]\n'


def test_change_of_a_chain_is_that_of_its_factors(write, chain, fmus):
    found = {g.signal: g for g in sensitivity(write(chain + STATED), fmus=fmus)}
    assert set(found) == {"source.y", "lag.y", "gain.y"}
    source = found["source.y"]
    assert source.change == pytest.approx(3e-9, rel=1e-3)  # level 1 V and slope 2 V/s, in the same direction
    assert (source.unit, source.allowed, source.since, source.is_beyond) == ("V", 1e-6, math.inf, False)
    assert found["lag.y"].amplification == pytest.approx(found["lag.y"].change / (1e-9 * 10.0))


def test_signal_beyond_its_tolerance_is_told_with_its_time(write, chain, fmus):
    tight = STATED + 'tolerances = { "gain.y" = { rtol = 0.0, atol = 5e-10 } }\n'
    first, *others = sensitivity(write(chain + tight), fmus=fmus)
    assert (first.signal, first.is_beyond, [g.is_beyond for g in others]) == ("gain.y", True, [False, False])
    assert 0.0 < first.since < 1.0
    assert "gain.y: it changes by " in str(first) and f"allowed are 5e-10 A, first at t = {first.since:g} s" in str(
        first
    )


def test_numbers_that_may_not_change_stay_and_equal_ones_stay_equal(write, chain, fmus):
    path = write(chain + '[components.noise]\nfmu = "Noise"\n[inputs]\n')
    read, descriptions = prepare(path, fmus=fmus)
    other = perturb(read, descriptions, 1e-3, draw=0)
    values = {name: component.values for name, component in other.components.items()}
    assert "sample_time" not in values["noise"] and "seed" not in values["noise"]  # a time, and no Real
    assert "time.constant" not in values["lag"]
    assert abs(values["source"]["slope"] - 2.0) == pytest.approx(2e-3)
    limited = descriptions["gain"].variables["u"]
    assert (
        perturb_value(1000.0, limited, 1e-3, 0) == perturb_value(1000.0, limited, 1e-3, 1) == 999.0
    )  # its largest value
    assert perturb_value(0.0, limited, 1e-3, 0) == 0.0
    signs = {perturb_value(2.0, limited, 1e-3, draw) > 2.0 for draw in range(8)}
    assert signs == {True, False}
    unknown, share = replace(limited, unit=None), replace(limited, unit="1")
    assert perturb_value(3.0, unknown, 1e-3, 0) == 3.0 != perturb_value(3.5, unknown, 1e-3, 0)
    assert perturb_value(3.5, share, 1e-3, 0) == 3.5
    assert load(path).components["source"].values == {"slope": 2.0}
