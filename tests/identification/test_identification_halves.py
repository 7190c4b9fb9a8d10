"""The voltage between two samples: a clamp ends with the current, wherever that is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense.identification.coil.fit import fit_coil
from gapsense.identification.measurements.operations import mean_resistance
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.measurements.record import Columns, ends, halves, to_record
from gapsense.identification.options import CONVENTIONS
from gapsense.identification.valve.model import simulate
from gapsense.studies.devices import VALVE

CLAMPED = Path(__file__).parent / "records" / "synthetic-flyback-clamp.csv"
DT, FINE, R, L = 50e-6, 50, 10.0, 50e-3


def clamped(on, noise=0.0, clamp=-40.0):
    """Voltage and current of a coil at its samples, between which it is clamped to the end; edges are half-way."""
    v, i, now = [], [], 0.0
    for k in range(FINE * 1000):
        t = (k + 0.5) * DT / FINE - 20.5 * DT
        volts = 24.0 if 0.0 < t < on else clamp if now > 0.0 else 0.0
        now = max(now + DT / FINE / L * (volts - R * now), 0.0)
        v.append(volts)
        i.append(now)
    v, i = np.array(v)[FINE - 1 :: FINE], np.array(i)[FINE - 1 :: FINE]
    return v, i + noise * np.random.default_rng(1).standard_normal(i.size)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("length", [200, 220, 231, 247])
def test_clamp_ends_where_the_current_does(length, noise):
    v, i = clamped(length * DT, noise)
    values = {"time": np.arange(v.size) * DT, "voltage": v, "current": i}
    found = mean_resistance(to_record(Columns("c.csv", np.arange(v.size), values)))
    assert found == pytest.approx(R, rel=5e-4 + 0.3 * noise)
    ((k, part),) = ends(v, i)
    means = {convention: halves(v, i, convention)[k].mean() for convention in CONVENTIONS}
    assert means == dict.fromkeys(CONVENTIONS, pytest.approx(-40.0 * part, abs=1e-9))


def test_what_does_not_end_with_the_current_stays():
    v, i = clamped(200 * DT)
    assert not [*ends(v, np.roll(i, 20))]  # the current goes on
    assert not [*ends(np.maximum(v, 0.0), i)]  # no clamp
    assert not [*ends(*clamped(200 * DT, noise=5e-3))]  # not to be seen
    assert [k for k, _ in ends(-v, -i)] == [k for k, _ in ends(v, i)]


def test_record_with_a_clamp_is_that_of_its_coil():
    coil = fit_coil([read_record(CLAMPED)], conventions=CONVENTIONS)
    assert coil.is_explained and coil.form.parts == ()
    assert coil.parameters.resistance == pytest.approx(10.0, rel=4.0 * coil.errors["resistance"])
    explicit = -R * DT / np.log(1.0 - R * DT / L)  # the record was made by Euler's method
    assert coil.inductance == pytest.approx(explicit, rel=4.0 * coil.inductance_error)


def test_means_over_intervals_tell_where_the_voltage_jumps():
    """Also of PWM with pauses of two intervals, and from a high level to a low one of all three."""
    count, parts = 300, 10
    t = (np.arange(count * parts) + 0.5) / parts
    volts = np.where(
        t < 20.3,
        0.0,
        np.where(t < 60.7, 60.0, np.where(t < 160.2, 24.0 * ((t - 60.7) % 8.0 < 5.45), -40.0 * (t < 170.0))),
    )
    fine = simulate(VALVE, np.stack((volts, volts), axis=1), DT / parts, np.full(volts.size, 76.0)).current
    means = volts.reshape(count, parts).mean(axis=1)
    found = [
        simulate(VALVE, x, DT, np.full(count, 76.0)).current
        for x in (np.stack((means, means), axis=1), to_record(columns_of_means(means)).halves)
    ]
    flat, sharp = (np.abs(current - fine[parts - 1 :: parts]).max() for current in found)
    assert sharp < 3e-4 < 2e-3 < flat


def columns_of_means(means):
    """As they are read, with a current that tells nothing."""
    values = {"time": np.arange(means.size) * DT, "voltage": means, "current": np.zeros(means.size)}
    return Columns("m.csv", np.arange(means.size), values, is_mean=True)
