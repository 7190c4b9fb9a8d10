"""The drive voltage: values and volt-seconds against exact rational arithmetic, edges on points, generated code."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import accumulate, pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gapsense.drive import drive_voltage as drive
from gapsense.drive.drive_voltage import Inputs, Kind, Parameters, State, Waveform
from gapsense.fmi.tables import running_integral
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat

KERNEL = Kernel(drive)
TIMES = [0.0, 4e-3, 4e-3, 10e-3, 10e-3, 20e-3, 31e-3]
VOLTAGES = [0.0, 0.0, 30.0, 30.0, -5.0, 8.0, 8.0]
CYCLES = [0.0, 1e-3, 1e-3, 4e-3, 4e-3, 7e-3, 7e-3, 9.5e-3]
CYCLE_VOLTAGES = [0.0, 0.0, 24.0, 20.0, -1.0, 15.0, 0.5, 0.5]
BASE = Parameters(
    waveform=Waveform.square,
    square_amplitude=30.0,
    square_low=0.0,
    square_period=20e-3,
    square_duty=0.5,
    square_delay=0.0,
    step_initial=-0.1,
    step_final=30.3,
    step_time=7e-3,
    table_file_time=TIMES,
    table_file_voltage=VOLTAGES,
    table_file_integral=running_integral(TIMES, VOLTAGES),
    table_period=0.0,
    table_repeat_from=0.0,
    pwm_high=30.0,
    pwm_low=-30.0,
    pwm_frequency=1e3,
    profile_amplitude=32.0,
    profile_low=-2.0,
    profile_first=3.5e-3,
    profile_second=1.25e-3,
    profile_half_period=10e-3,
    profile_delay=0.4e-3,
    soft_landing_file_time=CYCLES,
    soft_landing_file_voltage=CYCLE_VOLTAGES,
    soft_landing_file_integral=running_integral(CYCLES, CYCLE_VOLTAGES),
    soft_landing_period=6e-3,
    soft_landing_repeat_from=4e-3,
    bridge_kind=Kind.full,
    bridge_supply=20.0,
    bridge_frequency=2e3,
    bridge_levels=0.0,
)
WAVEFORMS = {
    "square": Waveform.square,
    "step": Waveform.step,
    "table": Waveform.table,
    "pwm": Waveform.pwm,
    "profile": Waveform.profile,
    "cycles": Waveform.soft_landing,
    "bridge": Waveform.bridge,
}
REFERENCE = 12.0  # V, duty 0.7 of the PWM


def run(points, par, reference=REFERENCE, steps=None):
    """Voltages and means at `points`; the first is the start.  `steps` are the lengths, if not the differences."""
    step = KERNEL.scalar["step"]
    state, outputs = KERNEL.scalar["initial"]([points[0], 0.0, 1.0, reference], flat(par))
    rows = [outputs]
    for time, dt in zip(points[1:], steps or [b - a for a, b in pairwise(points)]):
        state, outputs = step(state, [time, dt, 1.0, reference], flat(par))
        rows.append(outputs)
    return np.array(rows).T


def wave_integral(p, duty):
    """Exact integral of the high fraction up to phase `p`."""
    return math.floor(p) * duty + min(p - math.floor(p), duty)


def exact_integral(t, par):
    """Exact integral of the voltage from time 0 to `t`, any sign, as a rational number."""
    t = Fraction(t)
    if par.waveform == Waveform.step:
        low, high = Fraction(par.step_initial), Fraction(par.step_final)
        edge = Fraction(par.step_time)
        return low * t + (high - low) * (max(t - edge, 0) - max(-edge, 0))
    if par.waveform == Waveform.table:
        columns = par.table_file_time, par.table_file_voltage
        return curve_integral(t, *columns, Fraction(par.table_period), Fraction(par.table_repeat_from))
    if par.waveform == Waveform.soft_landing:
        columns = par.soft_landing_file_time, par.soft_landing_file_voltage
        return curve_integral(t, *columns, Fraction(par.soft_landing_period), Fraction(par.soft_landing_repeat_from))
    if par.waveform == Waveform.profile:
        half, first, second = (
            Fraction(par.profile_half_period),
            Fraction(par.profile_first),
            Fraction(par.profile_second),
        )
        ends = [0, first, first + second, half, half + first, half + first + second]
        since = max(t - Fraction(par.profile_delay), 0)
        whole, rest = divmod(since, 2 * half)
        high = whole * half + sum(min(max(rest - a, 0), b - a) for a, b in zip(ends[::2], ends[1::2]))
        return Fraction(par.profile_low) * t + Fraction(par.profile_amplitude) * high
    if par.waveform == Waveform.pwm:
        low, high, period = Fraction(par.pwm_low), Fraction(par.pwm_high), 1 / Fraction(par.pwm_frequency)
        duty = min(max((Fraction(REFERENCE) - low) / (high - low), Fraction(0)), Fraction(1))
        return low * t + (high - low) * period * wave_integral(t / period, duty)
    if par.waveform == Waveform.bridge:
        rail, period = Fraction(par.bridge_supply), 1 / Fraction(par.bridge_frequency)
        return rail * period * wave_integral(t / period, Fraction(REFERENCE) / rail)
    low, period, duty = Fraction(par.square_low), Fraction(par.square_period), Fraction(par.square_duty)
    p = max((t - Fraction(par.square_delay)) / period, 0)
    return low * t + Fraction(par.square_amplitude) * period * wave_integral(p, duty)


def curve_integral(t, xs, ys, period, repeat_from):
    """Exact integral of a table from its first row to `t`; a part of it may repeat."""
    xs, ys, repeated = [Fraction(x) for x in xs], [Fraction(y) for y in ys], 0
    if period and t > repeat_from + period:
        count = (t - repeat_from) // period
        over = [curve_integral(x, xs, ys, Fraction(0), 0) for x in (repeat_from, repeat_from + period)]
        repeated, t = count * (over[1] - over[0]), t - count * period
    total = ys[0] * (min(t, xs[0]) - xs[0]) + ys[-1] * max(t - xs[-1], 0)
    for x0, x1, y0, y1 in zip(xs, xs[1:], ys, ys[1:]):
        if t > x0 and x1 > x0:
            x = min(t, x1)
            total += (x - x0) * (y0 + y0 + (y1 - y0) * (x - x0) / (x1 - x0)) / 2
    return total + repeated


def exact_mean(t0, t1, par):
    return float((exact_integral(t1, par) - exact_integral(t0, par)) / (Fraction(t1) - Fraction(t0)))


def edges(par, stop):
    """Times of the edges from 0 to `stop`."""
    if par.waveform == Waveform.step:
        return [par.step_time]
    if par.waveform == Waveform.table:
        return sorted({a for a, b in zip(par.table_file_time, par.table_file_time[1:]) if a == b})
    if par.waveform == Waveform.soft_landing:
        repeated = [n * 6e-3 + t for n in range(int(stop / 6e-3) + 1) for t in (4e-3, 7e-3, 10e-3)]
        return [1e-3, *repeated]
    if par.waveform == Waveform.profile:
        first, second, half = par.profile_first, par.profile_second, par.profile_half_period
        ends = [n * half + t for n in range(int(stop / half) + 2) for t in (0.0, first, first + second)]
        return [par.profile_delay + t for t in ends]
    if par.waveform == Waveform.pwm:
        period, duty, delay = 1.0 / par.pwm_frequency, 0.7, 0.0
    elif par.waveform == Waveform.bridge:
        period, duty, delay = 1.0 / par.bridge_frequency, REFERENCE / par.bridge_supply, 0.0
    else:
        period, duty, delay = par.square_period, par.square_duty, par.square_delay
    return [t for n in range(int(stop / period) + 2) for t in (delay + n * period, delay + (n + duty) * period)]


partitions = st.lists(st.floats(1e-7, 8e-3), min_size=1, max_size=30).map(lambda d: [*accumulate(d, initial=-1.05e-3)])
squares = st.builds(
    lambda amplitude, low, period, duty, delay: BASE._replace(
        square_amplitude=amplitude, square_low=low, square_period=period, square_duty=duty, square_delay=delay
    ),
    st.floats(0.0, 50.0),
    st.floats(-20.0, 20.0),
    st.floats(1e-4, 0.1),
    st.floats(0.0, 1.0),
    st.floats(-0.01, 0.05),
)
profiles = st.builds(
    lambda low, first, second, half, delay: BASE._replace(
        waveform=Waveform.profile,
        profile_low=low,
        profile_first=first * half,
        profile_second=min(second, 1.0 - first) * half,
        profile_half_period=half,
        profile_delay=delay,
    ),
    st.floats(-20.0, 20.0),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.floats(1e-4, 0.1),
    st.floats(-0.01, 0.05),
)
cycles = st.builds(
    lambda period, start: BASE._replace(waveform=Waveform.table, table_period=period, table_repeat_from=start),
    st.floats(1e-3, 0.05),
    st.floats(-5e-3, 40e-3),
)
waves = st.one_of(squares, profiles, cycles, st.sampled_from([BASE._replace(waveform=w) for w in WAVEFORMS.values()]))


@given(partitions, waves)
@settings(max_examples=300)
def test_means_of_any_partition_add_up_to_the_integral(points, par):
    _, means = run(points, par)
    total = math.fsum(m * (b - a) for m, a, b in zip(means[1:], points, points[1:]))
    expected = float(exact_integral(points[-1], par) - exact_integral(points[0], par))
    assert total == pytest.approx(expected, abs=1e-9 * 60.0 * (points[-1] - points[0]))


@given(partitions, waves)
@settings(max_examples=200)
def test_every_mean_is_exact(points, par):
    _, means = run(points, par)
    for mean, t0, t1 in zip(means[1:], points, points[1:]):
        moved = 2.0 * (1e-9 + 1e-11 * max(abs(t1), abs(t0)) / (t1 - t0))  # edges that count as on a point
        assert mean == pytest.approx(exact_mean(t0, t1, par), abs=60.0 * moved + 1e-9)


@pytest.mark.parametrize("waveform", WAVEFORMS.values(), ids=WAVEFORMS)
@given(st.floats(1e-5, 0.04), st.floats(1e-6, 1e-3))
def test_voltage_is_the_value_just_before_the_end(waveform, t, dt):
    par = BASE._replace(waveform=waveform)
    if min(abs(t - edge) for edge in edges(par, t)) > 1e-9:
        voltages, _ = run([t - dt, t], par)
        assert voltages[1] == pytest.approx(exact_mean(t - 1e-10, t, par), abs=1e-5)


@pytest.mark.parametrize("waveform", WAVEFORMS.values(), ids=WAVEFORMS)
def test_start_gives_the_value_before_the_start_and_no_mean_of_its_own(waveform):
    par = BASE._replace(waveform=waveform)
    for t in (-1e-3, 0.0, 5e-3, 7e-3, 1.0):
        voltage, mean = KERNEL.initial(Inputs(t, 123.0, 1.0, REFERENCE), par)[1]
        assert voltage == mean == pytest.approx(exact_mean(t - 1e-9, t, par), abs=1e-5)


GRIDS = {"a third of 0.1 ms": (1e-4 / 3.0, 300, 3000), "1/60 s": (1.0 / 60.0, 30, 600), "50 us": (5e-5, 200, 40_000)}


@pytest.mark.parametrize("start", [0.0, -1.05e-3])
@pytest.mark.parametrize("is_summed", [True, False], ids=["summed", "multiplied"])
@pytest.mark.parametrize("dt, half, count", GRIDS.values(), ids=GRIDS)
def test_edges_on_communication_points_are_clean_on_awkward_grids(dt, half, count, is_summed, start):
    par = BASE._replace(
        square_low=-0.1, square_amplitude=30.3, square_period=2 * half * dt, square_delay=start + 20 * dt
    )
    points = [*accumulate([dt] * count, initial=start)] if is_summed else [start + k * dt for k in range(count + 1)]
    voltages, means = run(points, par, steps=[dt] * count)
    low, high = par.square_low, par.square_low + par.square_amplitude
    expected = [high if k > 20 and (k - 21) // half % 2 == 0 else low for k in range(1, count + 1)]
    assert [*voltages[1:]] == expected
    assert [*means[1:]] == expected  # to the last bit: no sliver of the neighbouring level


@pytest.mark.parametrize("is_table", [False, True], ids=["step", "table"])
@pytest.mark.parametrize("k", [1, 2, 3, 299, 7001])
def test_jump_on_a_summed_communication_point(is_table, k):
    dt = 1e-4 / 3.0
    jump = k * 1e-4 / 3.0
    table = [0.0, jump, jump, 2.0 * jump]
    par = BASE._replace(
        waveform=Waveform.table if is_table else Waveform.step,
        step_initial=1.5,
        step_final=30.1,
        step_time=jump,
        table_file_time=table,
        table_file_voltage=[1.5, 1.5, 30.1, 30.1],
        table_file_integral=running_integral(table, [1.5, 1.5, 30.1, 30.1]),
    )
    points = [*accumulate([dt] * (2 * k), initial=0.0)]
    voltages, means = run(points, par, steps=[dt] * (2 * k))
    assert [*voltages[1:]] == [*means[1:]] == [1.5] * k + [30.1] * k


def test_edge_inside_a_step_keeps_its_volt_seconds():
    par = BASE._replace(square_delay=0.3e-3)
    voltages, means = run([0.0, 1e-3, 2e-3], par)
    assert [*voltages] == [0.0, 30.0, 30.0]
    assert [*means] == pytest.approx([0.0, 21.0, 30.0], rel=1e-12)


@pytest.mark.parametrize("duty, level", [(0.0, -2.0), (1.0, 28.0)])
@given(partitions)
@example([0.0, 0.02, 0.04, 0.06])
def test_duty_0_and_1_have_no_edges(duty, level, points):
    par = BASE._replace(square_low=-2.0, square_duty=duty, square_delay=-1.0)
    for outputs in run(points, par):
        assert np.all(outputs == level)


@pytest.mark.parametrize("reference", [-100.0, -30.0, 0.0, 12.3, 30.0, 100.0])
@pytest.mark.parametrize("periods", [1, 7, 1000])
def test_pwm_gives_its_reference_over_whole_periods(reference, periods):
    par = BASE._replace(waveform=Waveform.pwm)
    _, means = run([0.25e-3, 0.25e-3 + periods * 1e-3], par, reference)
    assert means[1] == pytest.approx(min(max(reference, -30.0), 30.0), abs=1e-9)


def test_pwm_carrier_starts_high_at_time_zero():
    voltages, means = run([0.0, 1e-4, 7e-4, 8e-4, 1e-3, 1.1e-3], BASE._replace(waveform=Waveform.pwm))
    assert [*voltages] == [-30.0, 30.0, 30.0, -30.0, -30.0, 30.0]
    assert [*means[1:]] == [30.0, 30.0, -30.0, -30.0, 30.0]


@pytest.mark.parametrize(("kind", "least"), [(Kind.full, -20.0), (Kind.half, 0.0)], ids=["full", "half"])
@pytest.mark.parametrize("frequency", [0.0, 2e3])
@given(reference=st.floats(-100.0, 100.0))
def test_bridge_gives_its_reference_within_its_supply_over_whole_periods(kind, least, frequency, reference):
    par = BASE._replace(waveform=Waveform.bridge, bridge_kind=kind, bridge_frequency=frequency)
    voltages, means = run([0.25e-3, 4.25e-3], par, reference)
    assert means[1] == pytest.approx(min(max(reference, least), 20.0), abs=1e-9)
    assert voltages[1] in (0.0, -20.0, 20.0) or frequency == 0.0


@given(reference=st.floats(-30.0, 30.0), levels=st.integers(1, 4096))
def test_mean_of_a_bridge_with_levels_is_the_nearest_one(reference, levels):
    par = BASE._replace(waveform=Waveform.bridge, bridge_frequency=0.0, bridge_levels=float(levels))
    _, means = run([0.0, 1e-3], par, reference)
    assert abs(means[1] - min(max(reference, -20.0), 20.0)) <= 0.5 * 20.0 / levels * (1.0 + 1e-9)
    assert means[1] / 20.0 * levels == pytest.approx(round(means[1] / 20.0 * levels), abs=1e-9)


def test_pulses_of_a_full_bridge_point_one_way():
    par = BASE._replace(waveform=Waveform.bridge)
    voltages, _ = run([k * 25e-6 + 1e-6 for k in range(40)], par, -5.0)
    assert {*voltages[1:].tolist()} == {0.0, -20.0}


def test_table_holds_its_ends_and_takes_jumps_in_its_first_and_last_row():
    times, voltages = [0.0, 0.0, 1.0, 1.0], [5.0, 10.0, 20.0, -3.0]
    par = BASE._replace(
        waveform=Waveform.table,
        table_file_time=times,
        table_file_voltage=voltages,
        table_file_integral=running_integral(times, voltages),
    )
    shown, means = run([-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0], par)
    assert [*shown] == [5.0, 5.0, 5.0, 15.0, 20.0, -3.0, -3.0]
    assert [*means[1:]] == [5.0, 5.0, 12.5, 17.5, -3.0, -3.0]
    assert run([-1.0, 3.0], par)[1][1] == pytest.approx((5.0 + 15.0 - 6.0) / 4.0)


def test_profile_is_that_of_the_paper():
    par = BASE._replace(
        waveform=Waveform.profile, profile_amplitude=30.0, profile_low=0.0, profile_delay=0.0, profile_half_period=20e-3
    )
    ends = [3.5e-3, 4.75e-3, 20e-3, 23.5e-3, 24.75e-3, 40e-3, 43.5e-3]
    voltages, means = run([0.0, *ends], par)
    assert [*voltages[1:]] == [*means[1:]] == [30.0, 0.0, 30.0, 0.0, 30.0, 0.0, 30.0]


def test_profile_breaking_mirrors_its_making():
    par = BASE._replace(waveform=Waveform.profile, profile_low=0.0, profile_delay=0.0)
    points = [k * 1e-4 + 3e-5 for k in range(101)]
    making, breaking = run(points, par)[1], run([t + 10e-3 for t in points], par)[1]
    assert making[1:] + breaking[1:] == pytest.approx(np.full(100, par.profile_amplitude), abs=1e-9)


def test_profile_pulses_longer_than_the_half_period_are_cut_off():
    par = BASE._replace(
        waveform=Waveform.profile, profile_low=0.0, profile_delay=0.0, profile_first=8e-3, profile_second=5e-3
    )
    voltages, _ = run([0.0, 7.9e-3, 8.1e-3, 10e-3, 10.1e-3, 18e-3, 18.1e-3, 20e-3, 20.1e-3], par)
    assert [*voltages[1:]] == [32.0, 0.0, 0.0, 0.0, 0.0, 32.0, 32.0, 32.0]
    alone, _ = run([0.0, 9.9e-3, 10.1e-3], par._replace(profile_first=1.0))
    assert [*alone[1:]] == [32.0, 0.0]


def test_table_repeats_its_end_and_plays_its_beginning_once():
    par = BASE._replace(waveform=Waveform.soft_landing)
    voltages, means = run([0.0, 1e-3, 4e-3, 7e-3, 10e-3, 13e-3, 16e-3, 19e-3], par)
    assert [*voltages] == pytest.approx([0.0, 0.0, 20.0, 15.0, 0.5, 15.0, 0.5, 15.0])
    assert [*means[1:]] == pytest.approx([0.0, 22.0, 7.0, 0.5, 7.0, 0.5, 7.0])
    far = 4e-3 + 6e-3 * 1e5
    assert [*run([far, far + 3e-3, far + 6e-3], par)[1][1:]] == pytest.approx([7.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("is_summed", [True, False], ids=["summed", "multiplied"])
def test_repeated_jumps_on_communication_points_are_clean(is_summed):
    dt = 1e-4 / 3.0
    table = [0.0, 100 * dt, 100 * dt, 300 * dt]
    par = BASE._replace(
        waveform=Waveform.table,
        table_file_time=table,
        table_file_voltage=[1.5, 1.5, 30.1, 30.1],
        table_file_integral=running_integral(table, [1.5, 1.5, 30.1, 30.1]),
        table_period=300 * dt,
    )
    count = 30_000
    points = [*accumulate([dt] * count, initial=0.0)] if is_summed else [k * dt for k in range(count + 1)]
    voltages, means = run(points, par, steps=[dt] * count)
    assert [*voltages[1:]] == [*means[1:]] == ([1.5] * 100 + [30.1] * 200) * 100


@pytest.mark.parametrize("waveform", WAVEFORMS.values(), ids=WAVEFORMS)
@pytest.mark.parametrize("enable, is_on", [(0.0, False), (0.5, False), (0.51, True), (1.0, True)])
def test_enable_switches_both_outputs_to_zero(waveform, enable, is_on):
    par = BASE._replace(waveform=waveform)
    _, outputs = KERNEL.step(State(7e-3), Inputs(8.1e-3, 1e-4, enable, REFERENCE), par)
    assert all(bool(x) is is_on for x in outputs)


def test_running_integral_of_a_ramp_and_a_jump():
    assert running_integral([0.0, 2.0, 2.0, 3.0], [0.0, 4.0, 1.0, 1.0]) == [0.0, 4.0, 4.0, 5.0]


def steps_of(seed, count):
    """Inputs of successive steps of varied length; many end on edges."""
    rng = np.random.default_rng(seed)
    time, made = -1e-3, []
    for _ in range(count):
        dt = float(rng.choice([0.0, 1e-4, 1e-3, 1e-4 / 3.0, rng.uniform(0.0, 5e-3)]))
        time += dt
        made.append(Inputs(time, dt, float(rng.uniform() < 0.9), float(rng.uniform(-40.0, 40.0))))
    return made


@pytest.mark.parametrize("waveform", WAVEFORMS.values(), ids=WAVEFORMS)
def test_generated_code_gives_the_bits_of_the_source(waveform):
    par = BASE._replace(waveform=waveform)
    inputs = steps_of(1, 1000)
    state, outputs = drive.initial(inputs[0], par)
    state_made, outputs_made = KERNEL.initial(inputs[0], par)
    for row in inputs[1:]:
        assert flat(state) == flat(state_made)
        assert [x.hex() for x in flat(outputs)] == [x.hex() for x in flat(outputs_made)]
        state, outputs = drive.step(state, row, par)
        state_made, outputs_made = KERNEL.step(state_made, row, par)
