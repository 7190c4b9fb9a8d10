"""Whether a model explains a record, and what is said where it does not."""

from __future__ import annotations

import numpy as np
import pytest
from valve_records import DT, ON, PERIOD, record

from gapsense.identification.options import CONVENTIONS
from gapsense.identification.residual import residual, verdict
from gapsense.identification.valve.form import EVERYTHING, Form
from gapsense.identification.valve.minimise import Fit, best_reading
from gapsense.identification.valve.model import prepare, prepare_all, simulate, simulate_experiment
from gapsense.studies.devices import VALVE


def left(measured, current):
    """The residual of a record, measured as `current`, with the model that made it."""
    experiment, _ = prepare(measured)
    model = simulate_experiment(
        VALVE, experiment._replace(resistance=np.full(experiment.current.size, VALVE.coil_resistance))
    )
    first = experiment.first
    return residual(measured._replace(current=current(measured, model, first)), model, first)


def as_it_is(measured, model, first):
    return measured.current


def with_eddy_currents(measured, model, first):
    """In a core that conducts, they need a current of their own, by the slope of the flux linkage."""
    return measured.current + 1e-3 * (measured.applied - VALVE.coil_resistance * measured.current)


def with_an_offset(measured, model, first):
    return measured.current + 5e-3


def with_less_voltage(measured, model, first):
    lost = np.where(measured.voltage > 15.0, 0.9 / VALVE.coil_resistance, 0.0)
    return measured.current - np.convolve(lost, np.exp(-np.arange(60) / 15.0) / 15.0)[: lost.size]


def rounded(measured, model, first):
    return np.round(measured.current / 2e-3) * 2e-3


def rounded_coarsely(measured, model, first):
    return np.round(measured.current / 4e-3) * 4e-3


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("current", [as_it_is, rounded, rounded_coarsely])
def test_noise_is_no_misfit(seed, current):
    found = left(record(seed=seed), current)
    assert found.is_explained and abs(found.correlation) < 0.1
    assert "explains the current to 1 mA" in verdict(found, "1 mA", "2 mA")


@pytest.mark.parametrize(
    ("current", "places", "cause"),
    [
        (with_eddy_currents, {"edges", "motion"}, "voltage is between|core losses"),
        (with_an_offset, {"rest", "decay", "motion"}, "offset|core losses"),
        (with_less_voltage, {"hold"}, "drops of the driver"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(current, places, cause):
    found = left(record(seed=4), current)
    assert not found.is_explained and found.worst in places
    said = verdict(found, "3 mA", "1 mA")
    assert "leaves 3 mA of the current, more than 1 mA" in said and "does not explain" in said
    assert sum(found.places.values()) == pytest.approx(1.0)
    assert any(word in said for word in cause.split("|"))


@pytest.mark.parametrize(("lead", "expected"), [(0, "end"), (1, "start")])
def test_voltage_between_samples_is_what_fits_best(lead, expected):
    k = np.arange(10 + round(PERIOD / DT))
    applied = np.where((k > 10) & (k < 11 + round(ON / DT)), 30.0, 0.0)  # during the interval before each sample
    made = simulate(VALVE, np.stack((applied, applied), axis=1), DT, np.full(k.size, VALVE.coil_resistance))
    current = made.current + 1e-3 * np.random.default_rng(6).standard_normal(k.size)
    measured = record(periods=1)._replace(times=k * DT, voltage=np.roll(applied, -lead), current=current)
    readings = [prepare_all([measured], None, name).firsts for name in CONVENTIONS]
    best, _ = best_reading(Fit(Form(VALVE)), np.zeros(6), readings, EVERYTHING)
    assert CONVENTIONS[best] == expected


def test_misfit_of_a_record_without_any_noise_is_told():
    quiet = record(periods=1)
    long = np.zeros(2 * quiet.times.size)  # at rest for longer than it works: no second difference tells a noise
    measured = quiet._replace(
        times=DT * np.arange(long.size + quiet.times.size),
        voltage=np.concatenate((long, quiet.voltage)),
        current=np.concatenate((long, quiet.current)),
        halves=np.concatenate((np.stack((long, long), axis=1), quiet.halves)),
    )
    found = left(measured, with_eddy_currents)
    assert not found.is_explained and "times its noise" in verdict(found, "3 mA", "1 mA")
