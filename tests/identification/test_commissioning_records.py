"""Commissioning from records as people bring them: devices, drives, beliefs and instruments at random.

What is tuned was chosen on eight cases of another generator; these are judged on others.
"""

from __future__ import annotations

import numpy as np
import pytest
from actuator_records import CONDITIONS, FINE, OTHERS, Drive, Instruments, case, errors, measured, run

from gapsense.identification.actuator import fit
from gapsense.identification.actuator import fit as validation
from gapsense.identification.actuator import show as file
from gapsense.identification.actuator.drive import calm_noise, means, read_excitation
from gapsense.identification.actuator.show import actuator_tables

SEEDS = (101, 102)
GOAL = 15e-6  # m; RMS error of the position on other drives
PWM_GOAL = 20e-6  # m; with a clamp, which hides the way back, and edges that are all guesses


def commissioned(seed, condition, **changes):
    c, instruments = case(seed, condition), CONDITIONS[condition][1]
    made = measured(c.device, c.drive._replace(**changes), instruments._replace(seed=seed))
    return c, made, fit.commission([made.record], c.known)


def said(result, known):
    return " ".join(text for text in actuator_tables(result, known) if isinstance(text, str))


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("condition", CONDITIONS)
def test_positions_on_other_drives(condition, seed):
    """Where the command ends with exit code 0, it is right; it does so in all these conditions."""
    c, _, result = commissioned(seed, condition)
    assert result.is_explained, said(result, c.known)
    limit = PWM_GOAL if "PWM" in condition else GOAL
    assert max(errors(result.parameters, c.device)) < limit
    assert fit.position_error(result) < GOAL


@pytest.mark.slow
def test_offset_8_bits_and_100_us_with_a_clamp_give_the_positions():
    """All at once, in four operations."""
    c, made, result = commissioned(7, "offset, 8 bits, every 100 us", clamp=40.0)
    assert result.is_explained and made.record.offsets["current"].value == pytest.approx(5e-3, abs=1.5e-3)
    assert max(errors(result.parameters, c.device, OTHERS[:1])) < GOAL
    assert max(errors(c.known, c.device, OTHERS[:1])) > 23e-6
    off = result.parameters.coil_resistance / c.device.coil_resistance - 1.0
    assert abs(off) < 3.0 * result.errors["coil_resistance"] < 0.03
    written = file.complete(result, c.given)
    assert written["sample_time"] == 20e-6 and written["noise.current"] == pytest.approx(2.3e-3, rel=0.15)


@pytest.mark.slow
def test_a_drop_that_was_not_recorded_is_refused_by_name():
    c, made, _ = case(3), *measured(case(3).device, Drive(drop=0.7, pulses=1), Instruments())
    v = made.voltage
    command = made._replace(
        voltage=np.where(v < -0.3, v + 0.7, v), halves=np.where(made.halves < -0.3, 0.0, made.halves)
    )
    result = fit.commission([command], c.known)
    assert not result.is_explained
    assert "does not explain this record" in said(result, c.known) and "a drop in the path" in said(result, c.known)


def test_pwm_that_the_samples_miss_is_refused_by_name():
    fast = Drive(volts=40.0, pulses=1, carrier=220e-6, duty=0.7, clamp=40.0)
    c = case(5)
    made = measured(c.device, fast, Instruments(dt=100e-6))
    result = fit.commission([made.record], c.known)
    assert not result.is_explained and "fewer than 3 samples from edge to edge" in said(result, c.known)


def test_single_shots_together_and_one_more_for_the_validation():
    c = case(11)
    shots = [
        measured(c.device, Drive(volts=volts, on=9e-3, pulses=1), Instruments(seed=k), f"{volts:g} V").record
        for k, volts in enumerate((30.0, 24.0, 27.0))
    ]
    result = fit.commission(shots[:2], c.known)
    assert result.is_explained and [r.record for r in result.residuals] == ["30 V", "24 V"]
    assert max(errors(result.parameters, c.device, OTHERS[:1])) < GOAL
    check = validation.validate(result.parameters, *shots[2:])
    edges = np.abs(np.diff(check.record.voltage, prepend=0.0)) > 5.0
    error = (check.record.current[check.first :] - check.model.current)[~edges[check.first :]]
    assert error.std() < 2.6e-3


def test_a_mover_that_does_not_leave_its_stop_is_told():
    c = case(2)
    made = measured(c.device, Drive(volts=4.0, on=5e-3, period=12e-3, pulses=1), Instruments(noise=0.2e-3))
    result = fit.commission([made.record], c.known)
    assert "The mover does not leave its stop" in said(result, c.known)
    assert result.parameters.mover_mass == pytest.approx(c.given["mover.mass"], rel=1e-6)


def test_mean_voltages_of_steps_have_the_edge_where_it_is():
    halves = np.array([[0.0, 30.0], [30.0, 0.0]])
    found = means(halves, np.array([0.5, 0.1]), 5)
    assert found == pytest.approx(np.array([[0.0, 0.0, 15.0, 30.0, 30.0], [15.0, 0.0, 0.0, 0.0, 0.0]]))


def test_places_of_edges_are_found():
    """Within a tenth of a sampling period of 100 us each; those of a record in step with its drive are all alike."""
    c, made, result = commissioned(4, "every 100 us", pulses=2)
    (d,), (places,) = result.drives, result.places
    begins = c.drive.rest + np.array([0.0, c.drive.on])[:, None] + c.drive.period * np.arange(2)
    start = made.record.times[d.first] + FINE * int(np.random.default_rng(4).integers(20))
    true = np.sort(begins.ravel() - start) / made.record.dt % 1.0 - 0.5
    assert places == pytest.approx(true, abs=0.1)
    in_step = measured(c.device, Drive(pulses=2), Instruments(dt=50e-6, seed=9)).record
    (places,) = fit.commission([in_step], c.known).places
    assert np.ptp(places) < 0.01


def test_noise_is_not_what_pwm_does():
    c = case(6, "PWM, clamp of 40 V")
    record = measured(c.device, c.drive._replace(pulses=1), Instruments()).record
    d = read_excitation(record, c.known)
    is_edge = np.abs(np.diff(record.voltage, prepend=0.0)) > 5.0
    assert d.noise == pytest.approx(2e-3, rel=0.15)
    assert calm_noise(record, d.first, is_edge[d.first :]) == d.noise


def test_records_begin_and_end_without_current():
    """The bench itself: currents flow from the first edge on, and a clamp ends them at once."""
    c = case(1)
    _, current, position = run(c.device, Drive(pulses=1, clamp=40.0)).T
    assert np.all(current[: round(1e-3 / FINE)] == 0.0) and abs(current[-1]) < 1e-3
    assert np.ptp(position) == pytest.approx(c.device.stop_upper - c.device.stop_lower)
