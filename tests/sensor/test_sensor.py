"""The sensor chain: each error alone, their order, lost samples, seeds, contact thresholds, and the generated code."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import step_runs
from gapsense.kernels.layout import flat, record
from gapsense.sensor import sensor
from gapsense.sensor.sensor import Inputs, Parameters, State

KERNEL = Kernel(sensor)
IDEAL = Parameters(*[0.0] * len(Parameters._fields))._replace(sample_time=5e-5, seed=1.0)
NOISY = IDEAL._replace(noise_voltage=0.5, noise_current=2e-3)
REALISTIC = NOISY._replace(
    gain_error_voltage=0.01,
    gain_error_current=-0.02,
    offset_voltage=0.05,
    offset_current=-1e-3,
    resolution_voltage=0.01,
    resolution_current=1e-4,
    range_voltage=30.0,
    range_current=0.4,
    dropout_probability=0.1,
    contact_source=1.0,
    contact_lower=1e-4,
    contact_upper=9e-4,
    contact_hysteresis=5e-5,
)
TRUE = Inputs(voltage=12.0, current=0.25, position=5e-4, mode=2.0)


def readings(par, count, inputs=TRUE):
    """Outputs (count, 4) of successive samples, the first by `initial`."""
    state, outputs = KERNEL.scalar["initial"](flat(inputs), flat(par))
    rows = [outputs]
    for _ in range(count - 1):
        state, outputs = KERNEL.scalar["step"](state, flat(inputs), flat(par))
        rows.append(outputs)
    return np.array(rows)


def modes(par, positions, first=None):
    """Mode at each position, the first by `initial`."""
    state, outputs = sensor.initial(TRUE._replace(position=positions[0]), par)
    found = [outputs.mode_measured]
    for x in positions[1:]:
        state, outputs = sensor.step(state, TRUE._replace(position=x), par)
        found.append(outputs.mode_measured)
    return found


def shown(par, true):
    """Measured mode at each true mode, the first by `initial`."""
    state, outputs = sensor.initial(TRUE._replace(mode=true[0]), par)
    found = [outputs.mode_measured]
    for mode in true[1:]:
        state, outputs = sensor.step(state, TRUE._replace(mode=mode), par)
        found.append(outputs.mode_measured)
    return found


@pytest.mark.parametrize(
    ("bounce", "then"),
    [
        (0, [1] * 9),
        (1, [1, 2, 1, 1, 1, 1, 1, 1, 1]),
        (2, [1, 2, 2, 1, 2, 1, 1, 1, 1]),
        (3, [1, 2, 2, 2, 1, 2, 2, 1, 2]),
    ],
)
def test_contact_bounces_less_and_less_after_it_has_closed(bounce, then):
    par = IDEAL._replace(contact_bounce=float(bounce))
    assert shown(par, [3, 3, 2] + [1] * 9) == [3, 3, 2, *then]
    assert shown(par, [1, 1, 1]) == [1, 1, 1]
    assert shown(par, [2, 1, 1, 2, 2, 3]) == [2, 1, 2 if bounce else 1, 2, 2, 3]
    by_position = par._replace(contact_source=1.0, contact_lower=1e-4, contact_upper=9e-4, contact_hysteresis=5e-5)
    assert modes(by_position, [5e-4] + [1.2e-4, 0.9e-4] + [1.2e-4] * 8) == [2, 2, *then]


def test_ideal_sensor_shows_the_truth():
    assert np.all(readings(IDEAL, 5) == [12.0, 0.25, 2.0, 0.0])


def test_gain_and_offset_errors():
    par = IDEAL._replace(gain_error_voltage=0.01, gain_error_current=-0.1, offset_voltage=0.5, offset_current=0.02)
    assert readings(par, 2)[1] == pytest.approx([12.62, 0.245, 2.0, 0.0])


def test_saturation_comes_after_the_offset_and_before_the_code():
    par = IDEAL._replace(range_voltage=10.0, range_current=0.2, offset_voltage=-30.0, resolution_current=0.03)
    assert readings(par, 1)[0] == pytest.approx([-10.0, 0.21, 2.0, 0.0])  # 0.2 A has the code 7 * 0.03 A


@pytest.mark.parametrize("x, code", [(0.0, 0.0), (0.1, 0.0), (0.125, 0.25), (-0.125, 0.0), (-0.126, -0.25), (3.1, 3.0)])
def test_quantisation_is_mid_tread_with_ties_up(x, code):
    assert sensor._quantise(x, 0.0, 0.25) == code


@given(st.floats(-1e3, 1e3), st.floats(1e-6, 10.0))
def test_quantisation_gives_a_multiple_within_half_a_step(x, q):
    code = sensor._quantise(x, 0.0, q)
    assert abs(code - x) <= 0.5 * q * (1.0 + 1e-9) + 1e-12
    assert code == round(code / q) * q


@given(st.floats(-100.0, 100.0), st.floats(1e-3, 50.0))
def test_saturation_bounds_the_reading(x, limit):
    assert sensor._quantise(x, limit, 0.0) == max(-limit, min(limit, x))


def test_noise_has_its_standard_deviation_and_is_white():
    voltage, current = readings(NOISY, 20_000).T[:2]
    for x, mean, std in ((voltage, 12.0, 0.5), (current, 0.25, 2e-3)):
        assert stats.kstest((x - mean) / std, "norm").pvalue > 1e-3
        assert abs(np.corrcoef(x[1:], x[:-1])[0, 1]) < 4.0 / len(x) ** 0.5
    assert abs(np.corrcoef(voltage, current)[0, 1]) < 4.0 / len(voltage) ** 0.5


def test_same_seed_same_bits_other_seed_other_noise():
    a, b, c = readings(NOISY, 200), readings(NOISY, 200), readings(NOISY._replace(seed=2.0), 200)
    assert np.array_equal(a, b)
    assert not np.any(a[:, :2] == c[:, :2])
    assert abs(np.corrcoef(a[:, 0], c[:, 0])[0, 1]) < 0.3


def test_voltage_noise_leaves_current_noise_and_losses_as_they_were():
    par = NOISY._replace(dropout_probability=0.2)
    a, b = readings(par, 500), readings(par._replace(noise_voltage=0.0), 500)
    assert np.array_equal(a[:, 1:], b[:, 1:])
    assert np.all(b[:, 0] == 12.0)


def test_losses_leave_the_noise_of_the_other_samples_as_it_was():
    a, b = readings(NOISY._replace(dropout_probability=0.3), 500), readings(NOISY, 500)
    kept = a[:, 3] == 0.0
    assert np.array_equal(a[kept, :3], b[kept, :3])


def test_lost_samples_hold_the_last_reading():
    rows = readings(NOISY._replace(dropout_probability=0.3), 5000)
    is_lost = rows[1:, 3] == 1.0
    is_same = np.all(rows[1:, :3] == rows[:-1, :3], axis=1)
    assert np.array_equal(is_lost, is_same)
    assert abs(is_lost.mean() - 0.3) < 4.0 * math.sqrt(0.3 * 0.7 / len(is_lost))


def test_first_sample_is_never_lost():
    rows = readings(NOISY._replace(dropout_probability=1.0), 10)
    assert [*rows[:, 3]] == [0.0] + [1.0] * 9
    assert np.all(rows[:, :3] == rows[0, :3])


@pytest.mark.parametrize("mode", [1.0, 2.0, 3.0, 4.0])
def test_exact_contact_passes_the_mode_through(mode):
    assert np.all(readings(IDEAL, 3, TRUE._replace(mode=mode))[:, 2] == mode)


def test_contact_thresholds_have_hysteresis():
    par = IDEAL._replace(contact_source=1.0, contact_lower=1.0, contact_upper=9.0, contact_hysteresis=0.5)
    assert modes(par, [5.0, 1.0, 0.9, 1.4, 1.5, 1.6, 1.4, 0.9]) == [2, 2, 1, 1, 1, 2, 2, 1]
    assert modes(par, [5.0, 9.0, 9.1, 8.6, 8.5, 8.4, 8.6, 9.1]) == [2, 2, 3, 3, 3, 2, 2, 3]
    assert modes(par, [0.0, 10.0, 0.0]) == [1, 3, 1]


@given(st.lists(st.floats(0.0, 10.0), min_size=2, max_size=60))
def test_mode_follows_the_positions_alone(positions):
    par = IDEAL._replace(contact_source=1.0, contact_lower=2.0, contact_upper=8.0, contact_hysteresis=1.0)
    mode = 2
    for x, found in zip(positions, modes(par, positions)):
        if x < 2.0 or x > 8.0:
            mode = 1 if x < 2.0 else 3
        elif (mode == 1 and x > 3.0) or (mode == 3 and x < 7.0):
            mode = 2
        assert found == mode


def inputs_at(k):
    """Varied inputs that pass all stops, ranges and thresholds."""
    position = 5e-4 + 6e-4 * math.sin(0.31 * k)
    return Inputs(40.0 * math.sin(0.17 * k), 0.5 * math.cos(0.05 * k), position, float(k % 3 + 1))


@pytest.mark.parametrize("par", [IDEAL, NOISY, REALISTIC])
def test_generated_code_gives_the_bits_of_the_source(par):
    state, outputs = sensor.initial(inputs_at(0), par)
    state_made, outputs_made = KERNEL.initial(inputs_at(0), par)
    for k in range(1, 1500):
        assert flat(state) == flat(state_made)
        assert flat(outputs) == flat(outputs_made)
        state, outputs = sensor.step(state, inputs_at(k), par)
        state_made, outputs_made = KERNEL.step(state_made, inputs_at(k), par)


def test_many_runs_at_once_have_the_bits_of_single_runs():
    runs, steps = 12, 60
    seeds = np.arange(runs, dtype=float)
    par = flat(REALISTIC)
    par[Parameters._fields.index("seed")] = seeds
    rows = step_runs(KERNEL, np.array([flat(inputs_at(k)) for k in range(steps)])[:, :, None], par)
    for run, seed in enumerate(seeds):
        single = REALISTIC._replace(seed=float(seed))
        last, expected = KERNEL.initial(inputs_at(0), single)
        for k, row in enumerate(rows):
            if k:
                last, expected = KERNEL.step(last, inputs_at(k), single)
            assert row[:, run].tolist() == flat(expected)


def test_state_is_complete():
    state, _ = KERNEL.initial(TRUE, REALISTIC)
    for k in range(20):
        state, _ = KERNEL.step(state, inputs_at(k), REALISTIC)
    copy = record(State, flat(state))
    assert flat(KERNEL.step(copy, TRUE, REALISTIC)[0]) == flat(KERNEL.step(state, TRUE, REALISTIC)[0])


def test_mode_that_is_not_known_is_no_contact():
    """Hosts give 0 to what is not connected, and some at the start to what is."""
    assert [KERNEL.initial(TRUE._replace(mode=mode), IDEAL)[1].mode_measured for mode in (0.0, 1.0, 3.0)] == [2, 1, 3]
