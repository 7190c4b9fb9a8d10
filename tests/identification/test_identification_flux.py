"""Resistance and flux linkage, [UKF] (19)-(23)."""

from __future__ import annotations

import numpy as np
import pytest
from valve_records import PERIOD, record

from gapsense.identification.measurements.operations import edges, estimate, operations
from gapsense.identification.measurements.record import Columns, to_record
from gapsense.identification.valve.model import mean_resistance, prepare, simulate
from gapsense.studies.devices import VALVE

DT = 1e-4


def made(R, periods=4, length=100, offset=0.0):
    """A record that obeys v = R i + dlam/dt over every interval, with a resistance of each period."""
    k = np.arange(periods * length + 1)
    lam = 0.1 * (1.0 - np.abs(2.0 * (k % length) / length - 1.0))  # so that the voltage jumps at every start
    current = np.where(k % length < length // 2, 0.05 * np.sin(np.pi * (k % length) / (length // 2)) ** 2, 0.0) + offset
    mean = 0.5 * (current[1:] + current[:-1])
    resistance = np.repeat(np.asarray(R, dtype=float), length)
    voltage = resistance * mean + np.diff(lam) / DT
    voltage = np.concatenate((voltage[-1:], voltage))
    return to_record(Columns("r", k + 2, {"time": k * DT, "voltage": voltage, "current": current}, True)), lam


def test_resistance_of_each_period_is_exact_and_so_is_the_flux_linkage():
    warming = [70.0, 71.0, 71.5, 71.7]
    measured, lam = made(warming)
    flux = estimate(measured, operations(measured, period=100 * DT))
    np.testing.assert_allclose(flux.resistances, warming, rtol=1e-12)
    np.testing.assert_allclose(flux.flux_linkage, lam, atol=1e-15)
    together = mean_resistance(prepare(measured, period=100 * DT)[0])
    assert together == pytest.approx(np.mean(warming), rel=1e-12)


def test_printed_sums_are_biased_by_half_a_sample():
    measured = record(periods=2)
    flux = estimate(measured, operations(measured))
    assert flux.resistances == pytest.approx([76.0, 76.0], rel=3e-4)
    first = flux.operations[0].start
    truth = simulate(VALVE, measured.halves[first:], measured.dt, np.full(measured.times.size - first, 76.0))
    printed = np.cumsum(measured.voltage - 76.0 * measured.current)[first:] * measured.dt
    assert np.abs(flux.flux_linkage[first:] - truth.flux_linkage).max() < 5e-5
    assert np.abs(printed - truth.flux_linkage).max() > 5e-4


def test_periodicity_does_not_tell_the_offset():
    measured, lam = made([75.0] * 3, periods=3)
    names = ("times", "voltage", "current", "halves", "rows")
    late = measured._replace(**{name: getattr(measured, name)[30:] for name in names})
    found = operations(late, period=100 * DT)
    flux = estimate(late, found)
    np.testing.assert_allclose(flux.resistances, 75.0, rtol=1e-12)
    begin = found[0].start + 30
    np.testing.assert_allclose(flux.flux_linkage[found[0].start :], (lam - lam[begin])[begin:], atol=1e-15)


def test_operations_begin_before_the_voltage_rises_and_the_last_one_may_end_the_record():
    measured = record(periods=3, seed=1)
    found = operations(measured)
    assert [o.start for o in found] == edges(measured.voltage)[:3].tolist()
    assert {o.stop - o.start for o in found} == {round(PERIOD / measured.dt)}
    assert all(measured.voltage[o.start] < 1.0 and measured.voltage[o.start + 1] > 29.0 for o in found)
    assert len(operations(measured, period=PERIOD)) == 3


def test_drift_of_the_flux_linkage_is_gone_after_every_period():
    measured = record(periods=4, seed=2)
    flux = estimate(measured, operations(measured))
    ends = [flux.flux_linkage[o.stop] for o in flux.operations]
    assert np.abs(ends).max() < 1e-15
    rough = np.cumsum(measured.applied - 77.5 * measured.current) * measured.dt
    assert abs(rough[flux.operations[-1].stop]) > 1e-3
