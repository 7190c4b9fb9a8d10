"""The fit of [UKF] (24)-(25): it recovers what made the record, and its standard errors are true."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from valve_records import GUESS, record

from gapsense.identification.least_squares import long_run, square
from gapsense.identification.valve.driver import read_driver
from gapsense.identification.valve.errors import uncertainty
from gapsense.identification.valve.fit import POOR, fit_valve
from gapsense.identification.valve.form import FITTED, Form, Sought, larger
from gapsense.identification.valve.minimise import NEAR, Fit, Weighted, minimise_together, search
from gapsense.identification.valve.model import (
    balance,
    first_operation,
    integrate_flux,
    prepare,
    residuals,
    simulate,
    simulate_currents,
    simulate_experiment,
)
from gapsense.identification.valve.show import validate
from gapsense.studies.devices import VALVE


def errors(result) -> np.ndarray:
    """Relative errors of the identified parameters."""
    return np.array([getattr(result.parameters, name) / getattr(VALVE, name) - 1.0 for name in result.names])


@cache
def noise_free():
    return fit_valve([record()], GUESS, starts=1)


@cache
def noisy(seed: int, periods: int = 2):
    at_coil = read_driver("series=0")  # the voltage is that of the coil
    return fit_valve([record(seed=seed, periods=periods)], VALVE, starts=1, drive=at_coil)


def test_noise_free_record_gives_the_parameters_back():
    found = dict(zip(noise_free().names, np.abs(errors(noise_free()))))
    assert found.pop("damping") < 5e-3
    assert max(found.values()) < 5e-4, found
    assert found["coil_resistance"] < 1e-6  # (23) alone is wrong by 1e-4, by its trapezoids


def test_cost_is_that_of_the_paper():
    experiment, _ = prepare(record(seed=1))
    model = simulate(VALVE, experiment.halves, experiment.dt, experiment.resistance)
    i, lam = experiment.current, experiment.flux_linkage
    J = 10.0 / (i**2).max() * ((i - model.current) ** 2).sum()
    J += 1.0 / (lam**2).max() * ((lam - integrate_flux(experiment, model.current)) ** 2).sum()
    assert square(residuals(Form(VALVE), [np.zeros(6)], [experiment])[0]) == pytest.approx(J, rel=1e-12)
    assert np.abs(integrate_flux(experiment, model.current) - model.flux_linkage).max() < 5e-3 * lam.max()


def test_models_that_are_simulated_together_have_the_bits_that_they_have_alone():
    first, _ = prepare(record(seed=2))
    experiment = balance(Form(GUESS), np.zeros(6), first)  # each operation has a resistance of its own
    pars = [Form(GUESS).at(0.05 * np.random.default_rng(k).normal(size=6)) for k in range(7)]
    for par, found in zip(pars, simulate_currents(pars, experiment)):
        np.testing.assert_array_equal(found, simulate_experiment(par, experiment).current)


def test_residual_of_the_flux_linkage_is_the_integral_of_that_of_the_current():
    experiment, _ = prepare(record(seed=1))
    off = simulate(Form(VALVE).at(np.full(6, 0.01)), experiment.halves, experiment.dt, experiment.resistance).current
    r = experiment.current - off
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * experiment.resistance[1:]) * experiment.dt))
    np.testing.assert_allclose(experiment.flux_linkage - integrate_flux(experiment, off), -integral, atol=1e-12)


def test_balanced_charges_are_equal_in_every_operation():
    experiment, _ = prepare(record(seed=1))
    after = balance(Form(VALVE), np.zeros(6), experiment)
    again = balance(Form(VALVE), np.zeros(6), after)
    assert np.abs(after.resistance / experiment.resistance - 1.0).max() > 1e-5
    assert np.abs(again.resistance / after.resistance - 1.0).max() < 1e-5


def test_noisy_record_gives_them_back_within_four_standard_errors():
    result = noisy(1)
    z = errors(result) / result.uncertainty.relative
    assert np.abs(z).max() < 4.0, dict(zip(result.names, z))
    assert 0.001 < result.uncertainty.relative[FITTED.index("mover_mass")] < 0.05


def test_friction_is_not_identified_from_a_noisy_record_and_goes_with_the_mass():
    result = noisy(1)
    assert result.poor == ["damping"]
    k, j = FITTED.index("damping"), FITTED.index("mover_mass")
    assert result.uncertainty.correlation[k, j] < -0.9
    assert result.uncertainty.relative[k] > POOR


def uncertain(**options):
    return uncertainty(Form(VALVE), np.zeros(6), [prepare(record(seed=1, **options))[0]])


def test_more_periods_tell_more():
    np.testing.assert_allclose(uncertain(periods=4).relative, uncertain().relative / np.sqrt(2.0), rtol=0.15)


def test_record_without_motion_identifies_neither_mass_nor_spring_nor_damping():
    found = uncertain(volts=6.0)
    is_lost = np.isinf(found.relative)
    assert {n for n, lost in zip(FITTED, is_lost) if lost} == {"mover_mass", "spring_stiffness", "damping"}
    assert not np.isnan(found.correlation).any()


@pytest.mark.slow
def test_bad_minimum_is_rejected_by_its_cost():
    far = VALVE._replace(mover_mass=3.3 * VALVE.mover_mass, damping=4.0 * VALVE.damping, spring_stiffness=62.0)
    fit = Fit(Form(far))
    experiment = first_operation(prepare(record())[0])
    alone = fit.least_squares(np.zeros(6), [experiment])
    starts = fit.multi_start([experiment], 3, 1)
    costs = sorted(s.cost for s in starts)
    assert costs[0] <= square(residuals(Form(far), [alone], [experiment])[0]) + 1e-12
    assert costs[0] < 1e-3


def test_minima_that_are_sought_together_have_the_bits_that_they_have_alone():
    """Two forms with the same model, one with another, and one from two starts."""
    firsts, plain = [first_operation(prepare(record(seed=1))[0])], Form(GUESS)
    eddy, fringing = larger(plain, Sought(("eddy", "fringing")))
    forms = (plain, fringing, eddy, eddy)
    starts = [np.full(form.start.size, 0.05 * k) for k, form in enumerate(forms)]
    found = minimise_together([Weighted(form, firsts) for form in forms], starts, NEAR)
    for form, start, end in zip(forms, starts, found):
        np.testing.assert_array_equal(end.point, Fit(form).least_squares(start, firsts, NEAR))


def test_validation_on_another_drive_has_only_noise_left():
    check = validate(noisy(1).parameters, record(seed=9, volts=26.0, periods=1))
    assert 0.9e-3 < check.rms < 1.2e-3
    wrong = validate(VALVE._replace(coil_turns=1150.0), record(seed=9, volts=26.0, periods=1))
    assert wrong.rms > 3.0 * check.rms


def test_search_finds_minima():
    found = search(lambda x: float(((x - [1.0, -2.0, 3.0]) ** 2 * [1.0, 5.0, 9.0]).sum()), np.zeros(3))
    np.testing.assert_allclose(found.x, [1.0, -2.0, 3.0], atol=1e-5)
    curved = search(lambda x: float((1 - x[0]) ** 2 + 10.0 * (x[1] - x[0] ** 2) ** 2), np.array([-1.0, 1.0]))
    np.testing.assert_allclose(curved.x, [1.0, 1.0], atol=1e-2)
    assert search(lambda x: float(x @ x), np.ones(2), limit=50).evaluations < 60


def test_variance_of_a_weighted_sum_follows_the_autocovariance():
    rng = np.random.default_rng(1)
    white = rng.standard_normal(200_000)
    W = np.ones((1, white.size))
    assert long_run(W, white)[0, 0] == pytest.approx(white.size, rel=0.05)
    red = np.convolve(white, [0.5, 0.5, 0.5])[: white.size]
    assert long_run(W, red)[0, 0] == pytest.approx(white.size * 2.25, rel=0.07)
    assert float(red @ red) < 0.4 * white.size * 2.25 / 1.0  # what independent residuals would give


@pytest.mark.slow
def test_standard_errors_are_those_of_many_records():
    results = [noisy(100 + seed) for seed in range(30)]
    z = np.array([errors(r) / r.uncertainty.relative for r in results])
    spread = np.sqrt((z**2).mean(axis=0))
    assert np.all((spread > 0.65) & (spread < 1.45)), dict(zip(results[0].names, spread))
    assert np.all(np.abs(z.mean(axis=0)) < 3.5 / np.sqrt(len(results)))


@pytest.mark.slow
def test_least_squares_needs_a_small_part_of_the_evaluations_of_the_search():
    first, fit = first_operation(prepare(record(seed=1))[0]), Fit(Form(GUESS))
    ratios = fit.least_squares(np.zeros(6), [first])
    ours, needed = square(residuals(Form(GUESS), [ratios], [first])[0]), fit.samples / first.current.size
    theirs = search(
        lambda x: square(residuals(Form(GUESS), [x], [first])[0]), np.zeros(6), 0.1, limit=round(12 * needed)
    )
    assert ours < 0.99 * theirs.value
    assert theirs.value < 2.0 * ours  # but it gets there
