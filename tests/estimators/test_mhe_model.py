"""The model of `Mhe` and its derivatives against numpy, SciPy and finite differences."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mhe_signals import START, T_S, at_rest, blind, corrected_run, model_run, true_device
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.optimize import least_squares

from gapsense.estimators.mhe import mhe
from gapsense.estimators.mhe import model as mhe_model
from gapsense.estimators.mhe.mhe import SAME
from gapsense.estimators.mhe.model import Model, Point, bump, device, differentiate, gap_law, model
from gapsense.estimators.mhe.solve import DRIFT
from gapsense.estimators.mhe.window import priors
from gapsense.kernels.linalg import matrix
from gapsense.scenarios.estimators.parameters import VALVE

ALL = tuple(range(START + 1))
PULSE = np.r_[np.zeros(11), np.full(350, 30.0), np.zeros(400)]  # closes, is held, opens, rests


# magnetics


@given(st.floats(-1.3, 1.3))
def test_the_slope_of_the_core_is_its_derivative(share: float) -> None:
    d = device(blind())
    lam, e = share * d.saturation, 1e-7
    (_, above, _), (_, below, _) = (mhe_model.core((share + s * e) * d.saturation, d) for s in (1.0, -1.0))
    m, S, slope = mhe_model.core(lam, d)
    assert m == pytest.approx(share) and slope == pytest.approx((above - below) / (2.0 * e), rel=1e-5, abs=1e-8)
    if abs(share) < mhe_model.FULL:
        assert pytest.approx(share**3 / (1.0 - share**2)) == S


@given(st.floats(0.4e-3, 1.4e-3), st.floats(-0.1, 0.1))
def test_the_slopes_of_the_gap_are_its_derivatives(z: float, bend: float) -> None:
    m = model(blind(), device(blind())._replace(gap=1.1, bend=bend))
    e = 1e-8
    (above, steeper), (below, flatter) = (mhe_model.gap_at(z + s * e, m) for s in (1.0, -1.0))
    curvature = m.d.gap * gap_law(z, m.gap)[2] + bend * bump(z, m.gap)[2]
    assert mhe_model.gap_at(z, m)[1] == pytest.approx((above - below) / (2.0 * e), rel=1e-5)
    assert curvature == pytest.approx((steeper - flatter) / (2.0 * e), rel=1e-4)


def test_both_gap_laws_are_the_same_curve() -> None:
    """The table in the component's folder holds the fringing law; the bend keeps the stops."""
    laws = [model(blind(gap_law=law), device(blind())._replace(bend=0.1)) for law in (0.0, 1.0)]
    for z in np.linspace(0.4e-3, 1.4e-3, 50):
        (R, slope), (R_table, slope_table) = (mhe_model.gap_at(float(z), m) for m in laws)
        assert R_table == pytest.approx(R, rel=1e-3) and slope_table == pytest.approx(slope, rel=2e-2)
    for z in (0.4e-3, 1.4e-3):
        assert bump(z, laws[0].gap)[0] == 0.0


def test_the_core_that_is_nearest_to_froehlichs() -> None:
    """`CORE`, `KNEE` and `SATURATION` by least squares."""
    x = np.linspace(0.02, 0.9, 2001)

    def error(p: np.ndarray) -> np.ndarray:
        m = x / p[2]
        return (p[0] * x + p[1] * m**3 / (1.0 - m * m)) * (1.0 - x) / x - 1.0

    found = least_squares(error, [1.0, 1.0, 1.1], bounds=([0.0, 0.0, 0.91], np.inf), xtol=1e-14, ftol=1e-14)
    ours = np.array([mhe_model.CORE, mhe_model.KNEE, mhe_model.SATURATION])
    np.testing.assert_allclose(ours, found.x, rtol=0.02)
    assert np.sum(error(ours) ** 2) < 1.01 * np.sum(found.fun**2) and np.abs(error(ours)).max() < 0.1


# hysteresis


def resting_run(amplitude: float, voltage: np.ndarray) -> tuple[Model, np.ndarray]:
    """The model while the mover is held."""
    d = device(blind())._replace(hysteresis=amplitude, mass=1e9)
    m = model(blind(), d)
    return m, model_run(at_rest(m), voltage[1:].tolist(), m).points


def test_hysteresis_is_that_of_the_differential_equation() -> None:
    """Dahl's dh/dlambda = (I_h - s h)/L with L of the sample, exact over each step, against steps of SciPy."""
    m, points = resting_run(8e-3, PULSE)
    for k in range(5, 700, 31):
        (lam, h), (lam_next, h_next) = points[k, :2], points[k + 1, :2]
        L = m.length * max(0.1, 1.0 - 0.9 * (lam / m.d.saturation) ** 2)
        s = math.copysign(1.0, lam_next - lam)
        found = solve_ivp(lambda _, y, s=s, L=L: (8e-3 - s * y) / L, (lam, lam_next), [h], rtol=1e-11, atol=1e-15)
        assert h_next == pytest.approx(found.y[0, -1], rel=1e-9, abs=1e-13)


@given(st.lists(st.sampled_from([-30.0, 0.0, 5.0, 30.0]), min_size=3, max_size=8), st.floats(1e-3, 0.05))
@settings(max_examples=30)
def test_hysteresis_stays_within_its_amplitude_and_takes_energy(levels: list[float], amplitude: float) -> None:
    """Of a loop of flux linkage it keeps the energy; none comes out of a run from the virgin state."""
    _, points = resting_run(amplitude, np.repeat([0.0, *levels], 60))
    lam, h = points[:, 0], points[:, 1]
    assert np.abs(h).max() <= amplitude * (1.0 + 1e-12)
    assert cumulative_trapezoid(h, lam, initial=0.0).min() >= -1e-4 * amplitude * np.ptp(lam)


# energy


def test_energy_of_a_cycle_is_lost_in_hysteresis_damping_and_impacts() -> None:
    """From rest to rest: the integral of f over the flux linkage, with the force as the slope of the gap says it."""
    d = device(blind())
    m = model(blind(), d)
    points = model_run(at_rest(m), np.r_[PULSE[1:], np.zeros(600)].tolist(), m).points
    lam, h, z, v, a, _, _, _, f, _ = points.T
    impacts = np.flatnonzero((v[1:] == 0.0) & (v[:-1] != 0.0))
    share = (z[impacts + 1] - z[impacts]) / (T_S * (v + 0.5 * T_S * a)[impacts])
    speeds = v[impacts] + share * T_S * a[impacts]
    spent = {
        "hysteresis": np.trapezoid(h * (1.0 + (lam / d.saturation) ** 2), lam),
        "damping": d.damping * np.trapezoid(v * v) * T_S,
        "impacts": 0.5 * d.mass * np.sum(speeds**2),
    }
    assert impacts.size == 2 and abs(lam[-1]) < 0.02 * lam.max()
    assert min(spent.values()) > 0.0 and np.trapezoid(f, lam) == pytest.approx(sum(spent.values()), rel=0.01)


def test_a_mean_is_taken_as_it_is() -> None:
    """It is the same as a voltage that was there at the sample before too, to the bit."""
    m = model(blind(option_mean=1.0), device(blind()))
    at, other = at_rest(m, 0.01), model(blind(), device(blind()))
    for u in (-7.3, 0.0, 29.9):
        assert mhe_model.advance(at._replace(voltage=12.0), u, m) == mhe_model.advance(at._replace(voltage=u), u, other)


# derivatives


class Slopes(NamedTuple):
    """Derivatives of the current by all corrections (n, 12) at some samples; the position there."""

    samples: np.ndarray
    found: np.ndarray
    exact: np.ndarray
    position: np.ndarray


@cache
def slopes(block: int, finer: int = 1) -> Slopes:
    """Of a pulse, by steps of so many samples, of which a sampling period of the filter has some."""
    par = blind(sample_time=T_S / finer)
    par = par._replace(**{f"core_{name}": getattr(true_device(par), name) for name in ("eddy", "hysteresis")})
    voltage = np.repeat(PULSE, finer)
    samples, found = by_tangents(par, voltage, block)
    exact = np.array([difference(par, voltage, k)[samples] for k in ALL]).T
    return Slopes(samples, found, exact, corrected_run(par, np.zeros(START + 1), voltage).points[samples, 2])


def difference(par: mhe.Parameters, voltage: np.ndarray, k: int) -> np.ndarray:
    """Central difference of the current by a correction."""
    e = 1e-7 if k == START else 1e-5
    above, below = (corrected_run(par, s * e * np.eye(START + 1)[k], voltage).current for s in (1.0, -1.0))
    return (above - below) / (2.0 * e)


def by_tangents(par: mhe.Parameters, voltage: np.ndarray, block: int) -> tuple[np.ndarray, np.ndarray]:
    """As a window has it: after so many samples, and at impacts."""
    m = model(par, device(par))
    points = corrected_run(par, np.zeros(START + 1), voltage).points
    T = matrix([[1.0 if (k, n) == (START, 0) else 0.0 for n in range(4)] for k in ALL])
    since, moved, rows = 0, False, []
    for k in range(1, voltage.size):
        on_stop = points[k, 2] in (m.lower, m.upper)
        if (on_stop and moved) or k - since >= block:
            mean = 0.5 * (voltage[k - 1] + voltage[k])
            T, J = differentiate(T, ALL, Point(*points[k].tolist()), float(mean), float(k - since), on_stop, False, m)
            since = k
            rows.append((k, np.array(J, float)))
        moved = not on_stop
    samples, found = zip(*rows)
    return np.array(samples), np.array(found)


def errors(s: Slopes) -> dict[tuple[str, int], float]:
    """Relative RMS errors by phase of the pulse, where the derivatives have a hundredth of their usual size."""
    stop = np.isin(s.position, [VALVE.lower, VALVE.upper])
    turns = np.flatnonzero(stop[1:] != stop[:-1]) + 1
    phases = zip(("at rest", "closing", "held", "opening", "after the impact"), np.split(np.arange(stop.size), turns))
    size = np.sqrt(np.mean(s.exact**2, axis=0))
    found = {}
    for name, at in phases:
        own = np.sqrt(np.mean(s.exact[at] ** 2, axis=0))
        error = np.sqrt(np.mean((s.found - s.exact)[at] ** 2, axis=0))
        found.update({(name, k): error[k] / own[k] for k in ALL if own[k] > 0.01 * size[k]})
    return found


def test_derivatives_are_finite_differences() -> None:
    """In each phase: of one sample within 8 %, of a quarter within 2 %; of the four that a window takes within 35 %."""
    one, quarter, window = errors(slopes(1)), errors(slopes(1, finer=4)), errors(slopes(4))
    assert len(one) > 50
    assert max(one.values()) < 0.08 and max(quarter.values()) < 0.02 and max(window.values()) < 0.35
    assert np.median([*one.values()]) < 0.02 and np.median([*window.values()]) < 0.08


# what noise allows


def opening_deviations(noise: float, cycles: int) -> float:
    """Largest posterior deviation of the position in an opening [m], after so many cycles of a valve at 27 V.

    The covariance of (8) for a model that is right, linear around it: no estimator from current and voltage has less.
    """
    par, half = blind(), 500
    voltage, which = np.tile(np.repeat([27.0, 0.0], half), 2), range(8)
    q = np.r_[np.log(np.divide(true_device(par)[:9], device(par)[:9])), np.zeros(3)]

    def slopes(k: int) -> tuple[np.ndarray, np.ndarray]:
        step = 1e-4 * np.eye(q.size)[k]
        above, below = (corrected_run(par, q + sign * step, voltage) for sign in (1.0, -1.0))
        return (above.current - below.current) / 2e-4, (above.points[:, 2] - below.points[:, 2]) / 2e-4

    of_current, of_position = (np.array(s).T for s in zip(*map(slopes, which)))
    P, weight = np.diag(np.square(priors(par)[:8])), 1.0 / (noise**2 + SAME * par.model_error**2)
    for n in range(2 * cycles):
        window = slice(2 * half, 3 * half) if n % 2 == 0 else slice(3 * half, 4 * half)
        J, by = of_current[window], of_position[window]
        C = np.linalg.inv(np.linalg.inv(P) + weight * J.T @ J)
        P = C + np.diag(np.square(DRIFT[:8]))
    return float(np.sqrt(np.einsum("ij,jk,ik->i", by, C, by)).max())


def test_noise_of_20_mA_leaves_openings_uncertain() -> None:
    """Two deviations are 100 um after three cycles, which an innovation within the noise cannot tell."""
    assert 40e-6 < opening_deviations(20e-3, 3) < 55e-6
    assert 25e-6 < opening_deviations(20e-3, 15) < 40e-6
    assert opening_deviations(2e-3, 15) < 15e-6
