"""Long records made shorter."""

from __future__ import annotations

import numpy as np
import pytest
import valve_records as records

from gapsense.identification.measurements.operations import estimate, operations
from gapsense.identification.measurements.prepare import LONG, MOST_SAMPLES, average_blocks, shorten, thin
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.identification.valve import fit
from gapsense.studies.devices import VALVE

FINE = 1e-6


def fine(periods=2, seed=1, noise=5e-3) -> Record:
    """A record of the valve at 1 MS/s, from one at 10 us, with noise in each sample."""
    coarse = records.columns(periods=periods, dt=10e-6)
    t = np.arange(coarse["time"][0], coarse["time"][-1], FINE)
    rng = np.random.default_rng(seed)
    voltage = np.where((t > 0.0) & (np.mod(t - 1e-12, records.PERIOD) < records.ON), 30.0, 0.0)
    current = np.interp(t, coarse["time"], coarse["current"]) + noise * rng.standard_normal(t.size)
    return to_record(Columns("fine.csv", np.arange(t.size) + 2, {"time": t, "voltage": voltage, "current": current}))


@pytest.mark.parametrize("size", [2, 3, 7, 10])
def test_charge_and_volt_seconds_are_kept(size):
    rng = np.random.default_rng(size)
    n = 600
    values = {"time": np.arange(n) * FINE, "voltage": rng.normal(size=n), "current": rng.normal(size=n)}
    whole = to_record(Columns("x.csv", np.arange(n), values))
    made = average_blocks(whole, size)
    assert made.times.size == n // size and made.dt == pytest.approx(size * FINE)
    assert made.current.sum() * size == pytest.approx(whole.current[: made.times.size * size].sum())
    inside = slice((size - 1) // 2 + 1, None)  # from the middle of the first block to that of the last
    if size % 2:
        passed = whole.applied[inside][: (made.times.size - 1) * size].sum()
        assert made.applied[1:].sum() * size == pytest.approx(passed)
    np.testing.assert_allclose(made.voltage[1:], made.applied[1:])
    assert made.is_mean and made.times[0] == pytest.approx(0.5 * (size - 1) * FINE)


def test_ramp_stays_the_same_ramp():
    t = np.arange(1000) * FINE
    ramp = to_record(Columns("x.csv", np.arange(t.size), {"time": t, "voltage": 3.0 * t, "current": 2.0 * t}))
    made = average_blocks(ramp, 8)
    np.testing.assert_allclose(made.current, 2.0 * made.times, rtol=1e-9)
    np.testing.assert_allclose(made.applied[1:], 3.0 * (made.times[1:] - 0.5 * made.dt), rtol=1e-9)


def test_mode_and_position_go_along():
    t = np.arange(1000) * FINE
    mode = np.where(t > 0.5e-3, 2.0, 3.0)
    values = {"time": t, "voltage": t, "current": t, "mode": mode, "position": t}
    made = average_blocks(to_record(Columns("x.csv", np.arange(t.size), values)), 10)
    assert set(made.mode) == {2.0, 3.0}
    np.testing.assert_allclose(made.position, made.times)


def test_short_record_stays_as_it_is():
    short = records.record(periods=4)
    assert thin(short) is short and shorten(short) is short


def test_long_record_is_thinned_with_a_word_and_gives_resistance_and_flux():
    long = fine()
    assert long.times.size > LONG
    made = thin(long)
    assert made.times.size < LONG / 2
    assert "averaged" in made.remarks[-1] and f"{long.times.size} samples" in made.remarks[-1]
    flux = estimate(made, operations(made))
    np.testing.assert_allclose(flux.resistances, VALVE.coil_resistance, rtol=1e-3)
    assert flux.flux_linkage.max() == pytest.approx(21.1e-3, rel=2e-3)


@pytest.mark.slow
def test_thinned_record_identifies_the_valve():
    result = fit.fit_valve([thin(fine(periods=4))], records.GUESS, starts=1)
    for name in ("coil_turns", "core_saturation", "spring_stiffness"):
        assert getattr(result.parameters, name) == pytest.approx(getattr(VALVE, name), rel=5e-3)
    assert result.parameters.mover_mass == pytest.approx(VALVE.mover_mass, rel=0.02)
    assert result.is_explained


def test_record_of_many_operations_is_cut_to_the_first_ones_with_a_word():
    one = records.record(periods=1, seed=1)
    many = 1 + MOST_SAMPLES // one.times.size
    t = np.arange(many * one.times.size) * one.dt
    values = {"time": t, "voltage": np.tile(one.voltage, many), "current": np.tile(one.current, many)}
    made = shorten(to_record(Columns("x.csv", np.arange(t.size), values)))
    assert MOST_SAMPLES - 2 * one.times.size < made.times.size <= MOST_SAMPLES
    assert f"the first {len(operations(made))} of {many} operations" in made.remarks[-1]


def test_command_reads_all_where_samples_are_asked_for(tmp_path):
    whole = fine(periods=2)
    values = {"time": whole.times, "voltage": whole.voltage, "current": whole.current}
    file = records.write(tmp_path / "fine.csv", values)
    assert read_record(file, needs="samples").times.size == whole.times.size
    assert read_record(file).times.size < LONG
