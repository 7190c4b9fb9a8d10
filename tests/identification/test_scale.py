"""Error of the model and windows that `Mhe` is given, by the size and the speed of a device."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense.identification.measurements.record import Columns, to_record
from gapsense.identification.parameter_set import parameters_of
from gapsense.identification.residual import residual
from gapsense.identification.scale import find_tuning, spans_of
from gapsense.identification.valve.model import Trajectory

DEFAULTS = parameters_of("mhe", None)


def seen(dt=20e-6, amperes=0.4, motion=100, excess=0.0):
    """A closing of so many samples, which begins 50 samples after the voltage."""
    k = np.arange(1500)
    voltage, current = np.where((k >= 100) & (k < 1000), 30.0, 0.0), amperes * np.clip((k - 100) / 300.0, 0.0, 1.0)
    noise = 2e-3 * amperes * np.random.default_rng(1).standard_normal(k.size)
    record = to_record(Columns("x.csv", k, {"time": dt * k, "voltage": voltage, "current": current + noise}))
    model = Trajectory(current + excess, 0.05 * current, 1e-3 * (1.0 - np.clip((k - 150) / motion, 0.0, 1.0)))
    return [record], [model], [residual(record, model, 0)], DEFAULTS


def test_valve_for_which_the_defaults_are_made_keeps_them():
    assert find_tuning(*seen()) == {}


def test_slow_device_has_longer_windows():
    found = find_tuning(*seen(dt=100e-6, motion=300))
    motion, landing = spans_of(seen(dt=100e-6, motion=300)[0][0], seen(dt=100e-6, motion=300)[1][0])
    assert motion == pytest.approx(30e-3) and landing == pytest.approx(35e-3, rel=0.01)
    assert found["window.tail"] == pytest.approx(motion) and found["window.longest"] > landing + motion
    assert set(found) == {"window.tail", "window.longest"}


@pytest.mark.parametrize(("amperes", "error"), [(0.02, 1e-4), (20.0, 20e-3)])
def test_error_of_the_model_goes_with_the_current(amperes, error):
    assert find_tuning(*seen(amperes=amperes))["model.error"] == pytest.approx(error, rel=0.02)


def test_error_of_the_model_is_what_it_leaves():
    assert find_tuning(*seen(excess=5e-3))["model.error"] == pytest.approx(5e-3, rel=0.05)


def test_fast_samples_fit_into_a_window():
    assert find_tuning(*seen(dt=2e-6))["window.longest"] <= 2000 * 2e-6
