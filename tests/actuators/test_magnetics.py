"""Laws of the magnetic circuit at known points and by their definitions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from gapsense.actuators import magnetics
from gapsense.actuators.reluctance_actuator import Inputs as ActuatorInputs
from gapsense.actuators.reluctance_actuator import make_actuator
from gapsense.actuators.solenoid_valve import Inputs, _valve
from gapsense.studies.devices import RTS_VALVE, VALVE

LAWS = [0.0, 1.0, 2.0]
FLUXES = st.floats(-1.0, 1.0)


def circuit(law):
    return _valve(Inputs(0.0, 0.0, 0.0), VALVE._replace(gap_law=law)).circuit


@pytest.mark.parametrize("law", [0.0, 1.0])
@pytest.mark.parametrize("h", [-1e-5, 1e-6, 0.3e-3, 0.9e-3, 25e-3])
def test_slope_is_the_derivative_of_the_reluctance(law, h):
    c, d = circuit(law), 1e-9
    difference = (magnetics.gap_law(h + d, c)[0] - magnetics.gap_law(h - d, c)[0]) / (2 * d)
    assert magnetics.gap_law(h, c)[1] == pytest.approx(difference, rel=1e-6)


def test_fringing_vanishes_at_the_closed_gap():
    r0 = 1 / (magnetics.MU_0 * VALVE.gap_area)
    assert magnetics.gap_law(0.0, circuit(1.0)) == (0.0, r0)
    assert magnetics.gap_law(1e-9, circuit(1.0))[0] == pytest.approx(r0 * 1e-9, rel=1e-4)


def test_table_interpolates_both_columns_and_extrapolates():
    c = circuit(2.0)
    gaps, reluctances, slopes = VALVE.gap_file_gap, VALVE.gap_file_reluctance, VALVE.gap_file_slope
    assert len(gaps) == 19
    assert magnetics.gap_law(gaps[7], c) == pytest.approx((reluctances[7], slopes[7]))
    middle = magnetics.gap_law(0.5 * (gaps[7] + gaps[8]), c)
    assert middle == pytest.approx((0.5 * (reluctances[7] + reluctances[8]), 0.5 * (slopes[7] + slopes[8])))
    outside = magnetics.gap_law(2 * gaps[18] - gaps[17], c)
    assert outside == pytest.approx((2 * reluctances[18] - reluctances[17], 2 * slopes[18] - slopes[17]))


def test_shipped_table_is_the_fringing_law():
    """[UKF] has 19 points, from a finite-element model that is not printed; this law stands in for it."""
    r0, k = 1 / (magnetics.MU_0 * VALVE.gap_area), 1 / math.sqrt(VALVE.gap_area)
    assert VALVE.gap_file_gap == pytest.approx([0.05e-3 * n for n in range(19)])
    for h, reluctance, slope in zip(VALVE.gap_file_gap, VALVE.gap_file_reluctance, VALVE.gap_file_slope):
        assert magnetics.fringing(h, r0, k, 2 * VALVE.gap_window)[:2] == pytest.approx((reluctance, slope), rel=1e-12)


SMOOTH = {
    "fringing": RTS_VALVE,
    "table": RTS_VALVE._replace(
        gap_law=1.0,
        gap_file_gap=[0.2e-3, 0.5e-3, 0.9e-3, 1.6e-3],
        gap_file_reluctance=[7.6e6, 1.6e7, 2.5e7, 3.5e7],
        gap_file_spline=CubicSpline([0.2e-3, 0.5e-3, 0.9e-3, 1.6e-3], [7.6e6, 1.6e7, 2.5e7, 3.5e7])(
            [0.2e-3, 0.5e-3, 0.9e-3, 1.6e-3], 2
        ).tolist(),
    ),
}


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("h", [-0.1e-3, 0.1e-3, 0.4e-3, 0.5e-3, 0.7e-3, 1.4e-3, 2e-3])
def test_smooth_laws_have_two_derivatives(name, h):
    gap = make_actuator(ActuatorInputs(0.0, 0.0, 0.0), SMOOTH[name]).gap
    d = 1e-8
    before, law, after = (magnetics.smooth_gap_law(x, gap) for x in (h - d, h, h + d))
    assert all(map(math.isfinite, law))
    assert law[1] == pytest.approx((after[0] - before[0]) / (2 * d), rel=1e-6)
    assert law[2] == pytest.approx((after[1] - before[1]) / (2 * d), rel=1e-4, abs=1e6)


def test_spline_goes_through_its_rows_and_keeps_its_curvature_beyond():
    par = SMOOTH["table"]
    gap = make_actuator(ActuatorInputs(0.0, 0.0, 0.0), par).gap
    for h, R in zip(par.gap_file_gap, par.gap_file_reluctance):
        assert magnetics.smooth_gap_law(h, gap)[0] == pytest.approx(R, rel=1e-14)
    assert magnetics.smooth_gap_law(5e-3, gap)[2] == par.gap_file_spline[-1]
    inside = CubicSpline(par.gap_file_gap, par.gap_file_reluctance)
    for h in (0.3e-3, 0.77e-3, 1.2e-3):
        assert magnetics.smooth_gap_law(h, gap) == pytest.approx([float(inside(h, k)) for k in range(3)], rel=1e-12)


@given(FLUXES)
def test_core_reluctance_is_finite_and_positive_for_any_flux(lam):
    R = magnetics.core_law(lam, circuit(0.0))
    assert VALVE.core_reluctance <= R <= 1000.001 * VALVE.core_reluctance


@given(FLUXES, st.sampled_from(LAWS), st.floats(-1e-4, 2e-3))
def test_laws_are_finite_and_odd_or_even(lam, law, h):
    c = circuit(law)
    R, slope = magnetics.gap_law(h, c)
    assert all(map(math.isfinite, (R, slope, magnetics.current(lam, R, c), magnetics.energy(lam, R, c))))
    assert magnetics.current(-lam, R, c) == -magnetics.current(lam, R, c)
    assert magnetics.force(-lam, slope, c) == magnetics.force(lam, slope, c) <= 0.0


@pytest.mark.parametrize("lam", [-0.02, 0.001, 0.0211, 0.0239, 0.03])
def test_energy_is_the_integral_of_the_current_over_the_flux_linkage(lam):
    c = circuit(0.0)
    R = magnetics.gap_law(0.4e-3, c)[0]
    knee = math.copysign(magnetics.SATURATED * VALVE.core_saturation, lam)
    work, _ = quad(
        lambda x: magnetics.current(x, R + magnetics.core_law(x, c), c),
        0.0,
        lam,
        points=[knee],
        epsrel=1e-12,
        limit=200,
    )
    assert magnetics.energy(lam, R, c) == pytest.approx(work, rel=1e-9)


def test_force_is_the_falling_energy_at_constant_flux():
    c, h, d = circuit(1.0), 0.5e-3, 1e-8
    W = [magnetics.energy(0.01, magnetics.gap_law(x, c)[0], c) for x in (h - d, h + d)]
    assert magnetics.force(0.01, magnetics.gap_law(h, c)[1], c) == pytest.approx(-np.diff(W)[0] / (2 * d), rel=1e-6)
