"""The actuator of another physics: without losses that of [SEMERA], and each loss by its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

from gapsense.actuators import play_actuator, solenoid_valve
from gapsense.actuators.magnetics import MU_0
from gapsense.fmi.components import kernel_parameters, own
from gapsense.studies.devices import VALVE, drive

PLAY = kernel_parameters(own("play_actuator"), {})
STATIC = {"hysteresis_amplitude": 0.0, "eddy_fast": 0.0, "eddy_slow": 0.0}
LOCKED = PLAY._replace(spring_stiffness=0.0, initial_position=PLAY.stop_lower)  # the magnetic force holds it closed
STEP = 20e-6


def run(par, voltage, *names):
    return drive(play_actuator, par, np.asarray(voltage, float), STEP, *names).T


def square_wave(cycles, high=30.0):
    return np.where(np.arange(1000 * cycles) % 1000 < 500, high, 0.0)


def test_without_losses_it_is_the_solenoid_valve():
    fringing = float(solenoid_valve.GapLaw.fringing)
    plain = VALVE._replace(gap_law=fringing, stop_lower=0.1e-3, micro_step=5e-6)
    common = {n: getattr(plain, n) for n in PLAY._fields if n in plain._fields and not n.startswith("gap")}
    law = {"gap_slope": 1.0 / (MU_0 * plain.gap_area), "gap_fringing": plain.gap_area**-0.5}
    par = PLAY._replace(**common, **law, gap_window=2.0 * plain.gap_window, **STATIC)
    names, voltage = ("current", "position", "flux_linkage", "mode"), square_wave(2)
    expected = drive(solenoid_valve, plain, voltage, STEP, *names).T
    found = run(par, voltage, *names)
    assert set(expected[3]) == {1.0, 2.0, 3.0}
    for values, others in zip(found, expected):
        np.testing.assert_allclose(values, others, atol=1e-8 * np.abs(others).max())


@pytest.mark.parametrize("slower", [1.0, pytest.param(4.0, marks=pytest.mark.slow)])
def test_hysteresis_loop_has_its_area_whatever_the_rate(slower):
    """Each element of stiffness I / (3 r) goes round a parallelogram of area 4 (I / 3) (amplitude - r)."""
    par = LOCKED._replace(**STATIC | {"hysteresis_amplitude": 0.02}, coil_resistance=1e-6)
    t = np.arange(round(slower * 3000)) * STEP
    current, lam = run(par, 1.5 / slower * np.cos(2.0 * np.pi * t / (slower * 20e-3)), "current", "flux_linkage")
    cycle = slice(round(slower * 2000) - 1, None)
    amplitude = 0.5 * np.ptp(lam[cycle])
    assert amplitude > par.hysteresis_reach
    static = run(par._replace(**STATIC), 1.5 / slower * np.cos(2.0 * np.pi * t / (slower * 20e-3)), "current")[0]
    area = abs(trapezoid((current - static)[cycle], lam[cycle]))
    expected = sum(4.0 * 0.02 / 3.0 * (amplitude - share * par.hysteresis_reach) for share in (1 / 3, 2 / 3, 1.0))
    assert area == pytest.approx(expected, rel=5e-3)


def test_eddy_currents_follow_the_rate_of_the_flux_with_two_poles():
    par = LOCKED._replace(hysteresis_amplitude=0.0, coil_resistance=1e-6)
    voltage = np.full(400, 1.0)
    current, lam = run(par, voltage, "current", "flux_linkage")
    static = run(par._replace(**STATIC), voltage, "current")[0]
    t = np.arange(400) * STEP
    np.testing.assert_allclose(lam, t, rtol=1e-5)
    poles = ((par.eddy_fast, par.eddy_fast_time), (par.eddy_slow, par.eddy_slow_time))
    expected = [g * (1.0 - np.exp(-t / tau)) for g, tau in poles]
    np.testing.assert_allclose(current - static, np.add(*expected), atol=1e-8)


def test_it_moves_lands_and_falls_back_at_the_same_instants_with_half_the_step():
    found = [run(PLAY._replace(micro_step=h), square_wave(2), "position", "mode", "current") for h in (5e-6, 2.5e-6)]
    assert set(found[0][1]) == {1.0, 2.0, 3.0}
    np.testing.assert_array_equal(found[0][1], found[1][1])
    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-9)
    np.testing.assert_allclose(found[0][2], found[1][2], atol=2e-6)
