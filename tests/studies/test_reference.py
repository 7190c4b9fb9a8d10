"""Reference states and process noise against the paper's formulas in a plain loop."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from wrong_models import Textbook

from gapsense.estimators.reduced_model import gap_law
from gapsense.scenarios.soft_landing.reference import process_noise, reference_states, squared_noise
from gapsense.scenarios.soft_landing.setting import errors, fitted, gap_means, nominal, perturbed, unvaried

RUNS, WIDTH = 3, 0.2


def test_states_are_those_of_a_plain_loop(study):
    s, m = study.samples, study.model
    relative = WIDTH * errors(1, 0, RUNS)
    found = reference_states(s, perturbed(m, relative), m)
    z = (s.position - m.z_min) / m.l_z
    for run in range(RUNS):
        model = Textbook(m, relative[:, run], *gap_means(m))
        for k in range(1, s.time.size - 1):
            e_i = s.current[k] - model.current(z[k], s.flux_linkage[k])
            predicted = model.next_position(z[k], z[k - 1], s.flux_linkage[k], 0.0, s.mode[k], True)
            e_F = model.p["m"] * (z[k + 1] - predicted) / m.T_s**2
            assert found.current_error[run, k] == pytest.approx(e_i, rel=1e-9, abs=1e-12)
            assert found.force_error[run, k] == pytest.approx(e_F, rel=1e-7, abs=1e-11)


def test_process_noise_is_that_of_a_plain_loop(study):
    s, m = study.samples, study.model
    relative = WIDTH * errors(1, 0, RUNS)
    x = reference_states(s, perturbed(m, relative), m)
    total = np.zeros(3)
    for run in range(RUNS):
        e_i, e_F = x.current_error[run], x.force_error[run]
        for k in range(s.time.size - 1):
            predicted = s.flux_linkage[k] + m.T_s * (s.voltage[k] - m.R * s.current[k])  # f_i* + e_i is the current
            w = np.array([s.flux_linkage[k + 1] - predicted, e_i[k + 1] - e_i[k], e_F[k + 1] - e_F[k]])
            total += w * w
    found = process_noise(s, perturbed(m, relative), m)
    np.testing.assert_allclose(found[2:], total / (RUNS * (s.time.size - 1)), rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(found[:2]), 0.0, atol=1e-15)


def test_positions_have_no_noise_in_any_run(study):
    s, m = study.samples, study.model
    w = np.sqrt(squared_noise(s, perturbed(m, WIDTH * errors(1, 0, RUNS)), m) / (s.time.size - 1))
    assert w.shape == (5, RUNS)
    assert w[:2].max() < 1e-14 and np.all(w[2:].min(axis=1) > 1e-6 * np.array([1.0, 1.0, 1e-3]))


def test_many_runs_in_blocks_are_the_mean_of_single_ones(study):
    s, m, runs = study.samples, study.model, 250
    varied = perturbed(m, WIDTH * errors(1, 0, runs))
    singles = [process_noise(s, perturbed(m, WIDTH * errors(1, 0, runs)[:, [r]]), m) for r in range(runs)]
    np.testing.assert_allclose(process_noise(s, varied, m)[2:], np.mean(singles, axis=0)[2:], rtol=1e-12)


def test_wrong_gap_law_is_that_of_the_paper(study):
    """(56)-(57) with the means (53), by quadrature of the textbook law."""
    m = study.model
    mean = quad(lambda z: gap_law(z, m)[0], 0.0, 1.0)[0]
    mean_slope = quad(lambda z: gap_law(z, m)[1], 0.0, 1.0)[0]
    np.testing.assert_allclose(gap_means(m), [mean, mean_slope], rtol=1e-9)
    relative = 0.3 * errors(2, 0, 5)
    varied = perturbed(m, relative)
    for run in range(5):
        wrong = m._replace(gap_offset=float(varied.gap_offset[run]), gap_tilt=float(varied.gap_tilt[run]))
        for z in np.linspace(0.0, 1.0, 7).tolist():
            R, slope = gap_law(z, m)
            e = relative[:, run]
            assert gap_law(z, wrong)[0] == pytest.approx(R + mean * e[6] + (z - 0.5) * mean_slope * e[7], rel=1e-9)
            assert gap_law(z, wrong)[1] == pytest.approx(slope + mean_slope * e[7], rel=1e-9)


def test_nominal_model_is_table_ii():
    m = nominal()
    expected = {"m": 1.6e-9, "k_sp": 6.18e-5, "z_sp": 18.8, "c_f": 8e-7, "R_c0": 1.75, "lam_sat": 0.0238}
    assert {name: pytest.approx(getattr(m, name), rel=1e-12) for name in expected} == expected


def test_fit_leaves_the_smallest_current_error(study):
    s, m = study.samples, study.model

    def cost(R_c0, lam_sat):
        wrong = m._replace(R_c0=R_c0, lam_sat=lam_sat)
        return np.sum(reference_states(s, unvaried(wrong), wrong).current_error ** 2)

    best = cost(m.R_c0, m.lam_sat)
    for a, b in ((1.001, 1.0), (0.999, 1.0), (1.0, 1.0005), (1.0, 0.9995)):
        assert cost(a * m.R_c0, b * m.lam_sat) > best
    assert best < 0.1 * cost(1.75, 0.0238)
    again = fitted(s, nominal()._replace(R_c0=1.2, lam_sat=0.03))
    assert (again.R_c0, again.lam_sat) == pytest.approx((m.R_c0, m.lam_sat), rel=1e-6)


def test_fit_finds_the_core_that_made_the_current(study):
    s, m = study.samples, study.model
    z = (s.position - m.z_min) / m.l_z
    model = Textbook(m._replace(R_c0=1.9, lam_sat=0.026), np.zeros(8), 0.0, 0.0)
    current = np.array([model.current(*pair) for pair in zip(z, s.flux_linkage)])
    found = fitted(s._replace(current=current), m)
    assert (found.R_c0, found.lam_sat) == pytest.approx((1.9, 0.026), rel=1e-6)
