"""Soft landing: forward simulation gives the trajectory back, whatever the actuator; the impossible is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from c_code import run
from reluctance_dop853 import Oracle
from scipy.interpolate import CubicSpline

from gapsense.actuators import reluctance_actuator
from gapsense.scenarios.soft_landing.cycle import sampled, soft_landing
from gapsense.scenarios.soft_landing.inverse import SoftLandingError
from gapsense.scenarios.soft_landing.trajectory import FIG_5, Motion, Trajectory, mechanics
from gapsense.studies.devices import RTS_VALVE

CLOSE = 1e-8  # [m]
TABLE = RTS_VALVE._replace(
    gap_law=1.0,
    gap_file_gap=[0.0, 1e-3, 2e-3],
    gap_file_reluctance=[0.0, 2.8e7, 4.4e7],
    gap_file_spline=[-1.2e13, -1.2e13, -1.2e13],
)
WIDE = RTS_VALVE._replace(stop_lower=0.2e-3, stop_upper=1.6e-3, spring_stiffness=100.0, mover_mass=3e-3)
SLOW = Trajectory(
    period=50e-3, making_start=3e-3, making_duration=12.3e-3, breaking_start=30e-3, breaking_duration=7e-3
)


@pytest.fixture(scope="module")
def cycles():
    return soft_landing(RTS_VALVE, FIG_5, 2e-6, 3)


def forward(par, cycles, micro_step=2e-6):
    """Positions of the actuator's kernel at the rows of each cycle, under the mean voltage between two rows."""
    par = par._replace(micro_step=micro_step, initial_position=par.stop_upper)
    given, places = [(0.0, 0.0, 0.0)], []  # a row of a cycle is so many steps after the start
    for cycle in cycles:
        place, rows = [len(given) - 1], np.column_stack([cycle.time, cycle.voltage]).tolist()
        for (t, u), (t_next, u_next) in zip(rows[:-1], rows[1:]):
            given += [(t_next, t_next - t, 0.5 * (u + u_next))] if t_next > t else []
            place.append(len(given) - 1)
        places.append(place)
    positions = run(reluctance_actuator, given, par)[:, reluctance_actuator.Outputs._fields.index("position")]
    return [positions[place] for place in places]


@pytest.mark.parametrize(
    ("par", "trajectory", "step"),
    [
        pytest.param(RTS_VALVE, FIG_5, 2e-6, id="Fig. 5"),
        pytest.param(RTS_VALVE._replace(hysteresis=0.0), FIG_5, 2e-6, id="no hysteresis", marks=pytest.mark.slow),
        pytest.param(RTS_VALVE._replace(eddy_currents=0.0), FIG_5, 2e-6, id="no eddy currents", marks=pytest.mark.slow),
        pytest.param(RTS_VALVE._replace(saturation=0.0), FIG_5, 2e-6, id="no saturation", marks=pytest.mark.slow),
        pytest.param(TABLE, FIG_5, 2e-6, id="table"),
        pytest.param(WIDE, SLOW, 1e-6, id="wide and slow: unstable for longer", marks=pytest.mark.slow),
    ],
)
def test_forward_simulation_gives_the_trajectory_back(par, trajectory, step):
    cycles = soft_landing(par, trajectory, step, 2)
    for cycle, positions in zip(cycles, forward(par, cycles, step)):
        assert np.abs(positions - cycle.position).max() < CLOSE


@pytest.mark.slow
def test_independent_model_gives_the_trajectory_back(cycles):
    """The voltage is a spline through its rows: at the corners of straight lines a method of order 8 would crawl."""
    cycle, segments = cycles[0], []
    ends = [0, *(np.flatnonzero(np.diff(cycle.time) == 0.0) + 1), cycle.time.size]
    for a, b in zip(ends[:-1], ends[1:]):
        t, u = cycle.time[a:b], cycle.voltage[a:b]
        if t[-1] > t[0]:
            segments.append((t[0], t[-1], CubicSpline(t, u)))
    found, _, _ = Oracle(RTS_VALVE).run(segments, cycle.time)
    assert np.abs(found[:, 2] - cycle.position).max() < 1e-3 * CLOSE
    assert np.abs(found[:, 0] - cycle.flux).max() < 1e-8 * cycle.flux.max()


@pytest.mark.slow
def test_reproduction_is_limited_by_the_steps_of_the_voltage_only():
    errors = []
    for step in (8e-6, 4e-6, 2e-6):
        cycles = soft_landing(RTS_VALVE, FIG_5, step, 1)
        errors.append(np.abs(forward(RTS_VALVE, cycles, step)[0] - cycles[0].position).max())
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.1)


def test_cycle_repeats_from_the_second_on(cycles):
    scale = np.array([np.abs(x).max() for x in cycles[1]])
    for x, y, largest in zip(cycles[1], cycles[2], scale):
        assert np.abs(x - y).max() < 1e-9 * largest
    assert np.abs(cycles[0].voltage - cycles[1].voltage).max() > 0.1


@pytest.mark.parametrize("start", [1e-3, 11e-3])
def test_forces_balance_when_a_motion_starts(cycles, start):
    c = cycles[1]
    gap = RTS_VALVE.stop_upper if start < 10e-3 else RTS_VALVE.stop_lower
    _, slope = Oracle(RTS_VALVE).gap(gap)
    spring = RTS_VALVE.spring_stiffness * (RTS_VALVE.spring_rest - gap)
    for row in np.flatnonzero(np.abs(c.time - start) < 1e-12):
        assert 0.5 * slope * c.flux[row] ** 2 == pytest.approx(spring, rel=1e-10)
    lead = (c.time > start - 1e-3 + 1e-9) & (c.time < start - 1e-9)
    assert np.ptp(c.voltage[lead]) == 0.0


def test_motion_is_a_quintic_at_rest_at_both_ends():
    m = Motion(1e-3, 4e-3, 1.4e-3, 0.4e-3)
    t = 1e-3 + 4e-3 * np.linspace(0.0, 1.0, 11)
    x = np.array([mechanics(float(s), m) for s in t])
    z = np.polynomial.Polynomial.fit(t, x[:, 0], 5)
    for order in (1, 2, 3):
        derivative = z.deriv(order)(t)
        assert x[:, order] == pytest.approx(derivative, abs=1e-8 * np.abs(derivative).max())
    assert x[[0, -1], 1:3] == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    assert (x[0, 0], x[-1, 0]) == (1.4e-3, pytest.approx(0.4e-3, abs=1e-18))


def test_samples_at_jumps_and_contacts(cycles):
    s, c = sampled(cycles[1]), cycles[1]
    assert s.time.size == 1001
    starts, ends = [50, 550], [250, 750]
    assert s.voltage[0] == s.voltage[-1] == 0.0
    assert s.current[0] == pytest.approx(s.current[-1], abs=1e-9)
    for k in (*starts, *ends):
        rows = np.flatnonzero(np.abs(c.time - s.time[k]) < 1e-12)
        assert rows.size == 2
        assert s.voltage[k] == c.voltage[rows[0]] != c.voltage[rows[1]]
        assert s.current[k] == c.current[rows[0]]
    assert s.mode[[0, 50, 51, 249, 250, 550, 551, 749, 750, 1000]].tolist() == [3, 3, 2, 2, 1, 1, 2, 2, 3, 3]
    assert np.isin(s.position[s.mode != 2.0], [RTS_VALVE.stop_lower, RTS_VALVE.stop_upper]).all()


def test_samples_between_rows_are_interpolated(cycles):
    s = sampled(cycles[1], 7e-6)
    m = Motion(1e-3, 4e-3, RTS_VALVE.stop_upper, RTS_VALVE.stop_lower)
    inside = (s.time > 1e-3) & (s.time < 5e-3)
    assert s.position[inside] == pytest.approx([mechanics(t, m).position for t in s.time[inside]], abs=1e-9)


@pytest.mark.parametrize(
    ("par", "trajectory", "options", "message"),
    [
        ({}, {"breaking_start": 5.5e-3}, {}, "before the making has landed at 0.005 s"),
        ({}, {"period": 14e-3}, {}, "after the period of 0.014 s"),
        ({}, {"making_start": 0.5e-3}, {}, "before the period"),
        ({}, {"making_duration": 0.0}, {}, "must be positive"),
        ({}, {}, {"step": 0.0}, "must be positive"),
        ({}, {"lead": math.nan}, {}, "^`lead` is nan: finite numbers are expected"),
        ({"stop_lower": 2e-3}, {}, {}, "must be below `stop_upper`"),
        ({}, {"making_duration": 1.2e-3}, {}, "would have to push"),
        ({"spring_rest": 1e-3}, {}, {}, "must be above `stop_upper`"),
        ({}, {"hold_voltage": 1.0}, {}, "leaves its stop"),
        ({}, {}, {"highest_voltage": 26.0}, "needs 26"),
        ({}, {}, {"highest_voltage": 20.0}, "Make `lead` longer"),
        ({}, {"lead": 1e-5}, {}, "Make `lead` longer"),
    ],
)
def test_impossible_cycles_are_refused_with_the_reason(par, trajectory, options, message):
    with pytest.raises(SoftLandingError, match=message):
        soft_landing(RTS_VALVE._replace(**par), FIG_5._replace(**trajectory), **options)


def test_all_problems_are_told_at_once():
    with pytest.raises(SoftLandingError, match=r"before the period; .*after the period"):
        soft_landing(trajectory=FIG_5._replace(making_start=0.5e-3, period=14e-3))
