"""The smoother over a record: against batch conditioning, against the filter, and its component sample by sample."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from batch_gaussian import batch
from scipy.interpolate import CubicSpline
from smoother_runs import SHOWN, stepped
from valve_signals import AREA, T_S, WINDOW, exact, valve

from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.estimators.ekf import process_noise
from gapsense.estimators.reduced_model import Held, normalise_model, observation, transition
from gapsense.kernels.derivative import linearise
from gapsense.scenarios.soft_landing.rts import Operation, Posterior, motions, smooth_record

UNIT = np.array([1.0, 1.0, 0.02, 0.1, 1e-3])
PAPER = {"process_current_error_memory": 0.0}  # with the memory the filter has better velocities, the smoother the same
WRONG = {"spring_stiffness": 40.0, "coil_resistance": 78.0, "core_saturation": 0.0235}


@cache
def noise() -> np.ndarray:
    return 2e-3 * np.random.default_rng(3).standard_normal(valve(3).current.size)


def posterior(**changes: Any) -> Posterior:
    s = valve()
    return smooth_record(s.voltage, s.current + noise()[: s.current.size], s.mode, exact(**changes))


def rms(estimates: Any, name: str) -> float:
    moving = valve().mode == 2.0
    return float(np.sqrt(np.mean((getattr(estimates, name) - getattr(valve(), name))[moving] ** 2)))


def is_never_projected(p: Posterior, o: Operation) -> bool:
    inside = p.filtered.mean[o.first + 1 : o.landed, 0]
    return bool(np.all((inside > 0.0) & (inside < 1.0)))


@pytest.mark.parametrize("options", [{}, {"option_force_error": 0.0}, {"option_current_error": 0.0}], ids=str)
def test_equals_batch_conditioning_of_the_linearised_problem(options: dict[str, float]) -> None:
    """From a start where the positions are known exactly to the landing, measured without noise."""
    tuning = {"noise_current": 1e-3, "process_flux_linkage": 2e-5 if "option_force_error" in options else 2e-6}
    par = exact(**options, **tuning)
    p, s, m = posterior(**options, **tuning), valve(), normalise_model(par)
    current = s.current + noise()[: s.current.size]
    first, landed = next((o.first, o.landed) for o in p.operations if is_never_projected(p, o))
    Fs, offsets, Hs, Rs, ys = [], [], [np.zeros((0, 5))], [np.zeros(0)], [np.zeros(0)]
    for k in range(first, landed):
        x = p.filtered.mean[k]
        ahead, F = (np.array(a, float) for a in linearise(transition, x.tolist(), Held(s.voltage[k], s.mode[k]), m))
        h, H = (np.array(a, float) for a in linearise(observation, ahead.tolist(), m))
        Fs.append(F)
        offsets.append(ahead - F @ x)
        y, R = current[k + 1 : k + 2] - h + H @ ahead, np.array([1e-6])
        if k + 1 == landed:
            H, y, R = (
                np.vstack([H, [1.0, 0, 0, 0, 0]]),
                np.append(y, 0.0 if s.mode[landed] == 1.0 else 1.0),
                np.append(R, 0.0),
            )
        Hs.append(H)
        ys.append(y)
        Rs.append(R)
    Q = np.array(process_noise(m, par), float)
    scale, grid = np.diag(1.0 / UNIT), np.outer(UNIT, UNIT)  # in scaled states, for the batch's own rounding
    means, covariances = batch(
        p.filtered.mean[first] / UNIT, p.filtered.cov[first] / grid, [scale @ F / scale.diagonal() for F in Fs],
        Q / grid, [H * UNIT for H in Hs], Rs, ys, [offset / UNIT for offset in offsets],
    )  # fmt: skip
    np.testing.assert_allclose(p.smoothed.mean[first : landed + 1] / UNIT, means, atol=1e-9)
    np.testing.assert_allclose(p.smoothed.cov[first : landed + 1] / grid, covariances, atol=1e-9)


@pytest.mark.parametrize("changes", [PAPER, WRONG], ids=["right parameters", "wrong parameters"])
def test_is_better_than_the_filter(changes: dict[str, float]) -> None:
    p = posterior(**changes)
    for name in ("position", "velocity"):
        assert rms(p.smoothed, name) < 0.9 * rms(p.filtered, name)
    assert rms(p.smoothed, "position") < 60e-6
    rests = valve().mode != 2.0
    np.testing.assert_array_equal(p.smoothed.mean[rests], p.filtered.mean[rests])


def test_smoothed_estimates_are_bounded_and_surer_than_filtered_ones() -> None:
    for options in ({}, {"option_force_error": 0.0}, {"option_current_error": 0.0}, WRONG):
        p = posterior(**options)
        assert np.all((p.smoothed.mean[:, 0] >= 0.0) & (p.smoothed.mean[:, 0] <= 1.0))
        variances, before = (e.cov[:, range(5), range(5)] / UNIT**2 for e in (p.smoothed, p.filtered))
        assert np.all(variances >= 0.0) and np.all(variances <= before * (1.0 + 1e-9) + 1e-12)


def test_operations_are_those_of_the_plant() -> None:
    s, p = valve(), posterior()
    assert [(o.first, o.landed) for o in p.operations] == [(77, 170), (627, 759)]
    for o, true_speed in zip(p.operations, (1.32, 0.73)):
        assert o.takeoff_time == pytest.approx((o.first - 1) * T_S)
        assert (o.landed - 1) * T_S <= o.landing_time <= o.landed * T_S + 1e-12
        assert o.impact_speed == pytest.approx(true_speed, rel=0.04)
        assert abs(s.velocity[o.landed - 1]) == pytest.approx(true_speed, rel=0.04)


def test_table_of_the_gap_law_serves_as_well_as_its_formula() -> None:
    gaps = np.linspace(0.05e-3, 1.0e-3, 60)
    law = np.array([fringing(g, 1.0 / (MU_0 * AREA), AREA**-0.5, 2.0 * WINDOW)[0] for g in gaps])
    tables = {"gap_file_gap": gaps, "gap_file_reluctance": law, "gap_file_spline": CubicSpline(gaps, law)(gaps, 2)}
    by_table, by_formula = posterior(gap_law=1.0, **{k: v.tolist() for k, v in tables.items()}), posterior()
    for a, b in ((by_table.filtered, by_formula.filtered), (by_table.smoothed, by_formula.smoothed)):
        np.testing.assert_allclose(a.mean / UNIT, b.mean / UNIT, atol=2e-4)
        assert np.any(a.mean != b.mean)
    for a, b in zip(by_table.operations, by_formula.operations):
        assert a.impact_speed == pytest.approx(b.impact_speed, rel=1e-4)


def test_motions_that_do_not_start_or_end_in_the_record_are_left_out() -> None:
    assert motions([2, 2, 1, 1, 2, 3, 2, 2]) == [(4, 5)]
    assert motions([3, 3]) == motions([2, 2]) == motions([3, 2]) == []


def run_component(cycles: int, par: Any) -> dict[str, np.ndarray]:
    s = valve(cycles)
    return stepped(s.voltage, s.current + noise()[: s.current.size], s.mode, par)


@pytest.mark.parametrize("options", [{}, {"option_force_error": 0.0}, WRONG], ids=str)
def test_component_publishes_what_the_record_gives(options: dict[str, float]) -> None:
    s, par = valve(3), exact(**options)
    p = smooth_record(s.voltage, s.current + noise()[: s.current.size], s.mode, par)
    found = run_component(3, par)
    np.testing.assert_array_equal(found["position"], p.filtered.position)
    assert len(p.operations) == 6
    for o, after in zip(p.operations, [*p.operations[1:], None]):
        count = o.landed - o.first
        until = s.time.size if after is None else after.landed
        here = slice(o.landed, until)
        for name in ("takeoff_time", "landing_time", "impact_speed"):
            np.testing.assert_allclose(found[name][here], getattr(o, name), rtol=1e-9, atol=1e-12)
        shown = np.flatnonzero(found["smoothed_published"][here] == 1.0) + o.landed
        assert shown[0] == o.landed + count - 1
        np.testing.assert_array_equal(shown, shown[0] + np.arange(len(shown)))
        assert len(shown) == min(count, until - shown[0])
        samples = slice(o.first, o.first + len(shown))
        np.testing.assert_allclose(found["smoothed_time"][shown], s.time[samples], atol=1e-12)
        for name in SHOWN:
            expected = getattr(p.smoothed, name)[samples]
            np.testing.assert_allclose(
                found[f"smoothed_{name}"][shown], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max()
            )
