"""Coils without motion: what made a record is found, real ones are explained, and no moving valve is taken for one."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from coil_records import CORE, EDDY, HYSTERESIS, PLAIN, coil_record
from valve_records import record

from gapsense.identification.coil.fit import (
    KERNEL,
    RICHEST,
    Problem,
    effective,
    fit_coil,
    hidden,
    run,
    simulate,
    size_of,
    validate_coil,
)
from gapsense.identification.coil.show import remarks, tuning
from gapsense.identification.identify import coil_of
from gapsense.identification.least_squares import sample_outputs
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.options import CONVENTIONS
from gapsense.identification.valve.model import check_guess
from gapsense.problems import InputError
from gapsense.studies.devices import VALVE

RECORDS = Path(__file__).parent / "records"
CHANCE = 4.0  # standard errors
LOCKED = VALVE._replace(spring_stiffness=1e6 * VALVE.spring_stiffness)


@cache
def measured(name):
    return fit_coil([read_record(RECORDS / f"{name}.csv")], conventions=CONVENTIONS)


def test_coil_with_a_tube_of_iron_is_explained_as_it_was_recorded():
    coil = measured("tube-150-raw")
    assert coil.is_explained and coil.form is RICHEST
    assert coil.parameters.resistance == pytest.approx(0.371, rel=0.01)
    assert coil.residuals[0].rms < 0.012 * coil.records[0].current.max()
    assert abs(np.log(coil.parameters.resistance / 0.371)) < 2.0 * coil.errors["resistance"]
    assert set(coil.held) == {"saturation", "turnover"}  # the pulse reaches neither


def test_coil_without_iron_has_a_constant_inductance():
    coil = measured("empty-162-raw")
    assert coil.is_explained and coil.form.parts == () and not coil.held + coil.poor
    assert coil.inductance == pytest.approx(288e-6, rel=0.02)
    assert abs(coil.residuals[0].correlation) < 0.1


def test_what_the_converter_of_the_voltage_hides_is_within_half_a_step():
    for name in ("tube-150-raw", "empty-162-raw"):
        (voltage, current), *_ = measured(name).offsets
        assert 0.2 < voltage < 1.0 and current == 0.0


@pytest.mark.parametrize("name", ["tube-150-raw", "empty-162-raw"])
def test_what_the_converter_of_the_voltage_may_hide_is_in_the_error_of_the_resistance(name):
    coil = measured(name)
    assert coil.balanced is not None and tuning(coil)["prior.resistance"] == coil.balanced
    assert abs(np.log(coil.balanced / coil.parameters.resistance)) < coil.errors["resistance"]


def test_sound_converter_hides_nothing():
    coil = fit_coil([coil_record()])
    assert coil.balanced is None and "prior.resistance" not in tuning(coil)


def test_iron_is_seen_when_the_coil_without_it_predicts_the_other_record():
    check = validate_coil(measured("empty-162-raw"), measured("tube-150-raw").records[0])
    assert check.rms > 2.0 * measured("tube-150-raw").residuals[0].rms


DEVICES = {
    "constant inductance": {},
    "eddy currents": EDDY,
    "saturation": CORE,
    "hysteresis": HYSTERESIS,
    "saturation + eddy currents": {**CORE, **EDDY},
    "saturation + eddy currents + hysteresis": {**CORE, **EDDY, **HYSTERESIS},
}


QUICK = ("constant inductance", "eddy currents", "saturation + eddy currents + hysteresis")


@pytest.mark.parametrize("words", [w if w in QUICK else pytest.param(w, marks=pytest.mark.slow) for w in DEVICES])
def test_form_and_parameters_that_made_a_record_are_found(words):
    true = PLAIN._replace(**DEVICES[words])
    coil = fit_coil([coil_record(true)])
    assert coil.is_explained and coil.form.words == words
    for name, error in coil.errors.items():
        assert abs(np.log(getattr(coil.parameters, name) / getattr(true, name))) < CHANCE * error, name
    assert coil.errors["resistance"] < 1e-3


@pytest.mark.parametrize("floor", [pytest.param(False, marks=pytest.mark.slow), True])
@pytest.mark.parametrize("parts", [{}, CORE])
def test_coarse_converter_is_within_the_errors(parts, floor):
    true = PLAIN._replace(**parts)
    coil = fit_coil([coil_record(true, step=0.03, floor=floor)])
    assert coil.is_explained and coil.form.parts == (("core",) if parts else ())
    for name, error in coil.errors.items():
        assert abs(np.log(getattr(coil.parameters, name) / getattr(true, name))) < CHANCE * error, name


def test_two_records_have_one_coil_and_another_one_is_predicted():
    first, second, third = (coil_record(PLAIN._replace(**CORE), pulses=(v,), seed=k) for k, v in enumerate((12, 9, 6)))
    coil = fit_coil([first, second])
    assert coil.is_explained and coil.form.parts == ("core",) and len(coil.models) == 2
    assert validate_coil(coil, third).rms < 1.1 * coil.residuals[0].noise


@pytest.mark.parametrize("parts", [pytest.param({}, marks=pytest.mark.slow), EDDY])
def test_best_reading_of_the_voltage_is_taken_only_where_it_matters(parts):
    assert fit_coil([coil_record(PLAIN._replace(**parts))], conventions=CONVENTIONS).convention == "trapezoid"


@pytest.mark.parametrize(
    "options",
    [{}, {"volts": 24.0}, {"seed": 1}, {"volts": 24.0, "seed": 1}, {"volts": 20.0, "seed": 2}, {"volts": 40.0}],
)
def test_valve_that_moves_is_no_coil(options):
    coil, _ = coil_of("auto", [record(**options)], VALVE, None, CONVENTIONS)
    assert coil is None


def test_valve_that_moves_in_noise_and_in_short_pulses_is_no_coil(monkeypatch):
    assert coil_of("auto", [record(seed=1, noise=(0.15, 10e-3))], VALVE, None, CONVENTIONS)[0] is None
    monkeypatch.setattr("valve_records.ON", 1.5e-3)
    assert coil_of("auto", [record(seed=1)], VALVE, None, CONVENTIONS)[0] is None


@pytest.mark.parametrize("seed", [None, 1])
def test_valve_that_is_held_is_a_coil_that_saturates(seed):
    coil, told = coil_of("auto", [record(par=LOCKED, seed=seed)], VALVE, None, CONVENTIONS)
    assert coil is not None and coil.form.parts == ("core",) and not told
    assert coil.parameters.resistance == pytest.approx(VALVE.coil_resistance, rel=1e-3)
    off = abs(np.log(coil.parameters.saturation / VALVE.core_saturation))
    assert off < max(CHANCE * coil.errors["saturation"], 2e-3)


def test_records_that_do_not_agree_are_told():
    coil, (said,) = coil_of("auto", [record(periods=1, par=LOCKED, seed=1), record(periods=1, seed=1)], VALVE, None, ())
    assert coil is None and said == "valve: a coil without motion explains it, but not the others."
    others = [coil_record(pulses=(12.0,)), coil_record(PLAIN._replace(air=150.0), pulses=(12.0,))]
    coil, (said,) = coil_of("auto", others, VALVE, None, ())
    assert coil is not None and not coil.is_explained and "no one coil" in said


def test_device_that_is_neither_is_refused_with_a_word_on_the_coil():
    moving = record(seed=1)
    far = VALVE._replace(coil_turns=20.0 * VALVE.coil_turns)
    with pytest.raises(InputError, match="another device") as refused:
        coil_of("auto", [moving], far, None, ())
    assert "Nor does a coil without motion" in str(refused.value)
    assert coil_of("coil", [moving], far, None, ())[0] is not None


@pytest.mark.parametrize(("factor", "is_unit"), [(1e-3, True), (0.05, False)])
def test_current_in_another_unit_is_named(factor, is_unit):
    made = record(seed=1)
    with pytest.raises(InputError, match="another device") as refused:
        check_guess(VALVE, [made._replace(current=factor * made.current)])
    assert ("look at the units" in str(refused.value)) == is_unit


def test_models_that_are_simulated_together_have_the_bits_that_they_have_alone():
    each = run(coil_record(PLAIN._replace(**CORE)))
    problem = Problem(RICHEST, size_of([each.record]), [each])
    usual, high = problem.start, problem.limits[1]
    pars = [problem.parameters(usual + share * (high - usual), each) for share in (0.0, 0.1, 0.2)]
    voltages = each.voltages[:, :, None] + np.array([0.0, 0.1, 0.2])
    for k, found in enumerate(sample_outputs(KERNEL, pars, voltages)):
        np.testing.assert_array_equal(found, simulate(pars[k], voltages[:, :, k])[:, 0])


def test_only_some_of_correlated_residuals_count():
    white = np.random.default_rng(1).normal(size=20000)
    assert effective(white) == pytest.approx(white.size, rel=0.05)
    walk = np.zeros(white.size)
    for k in range(1, white.size):
        walk[k] = 0.8 * walk[k - 1] + white[k]
    assert effective(walk) == pytest.approx(white.size / 9.0, rel=0.35)  # (1 - 0.8) / (1 + 0.8)
    assert effective(np.zeros(100)) == 100.0


def test_converter_hides_offsets_only_where_noise_is_less_than_its_steps():
    rng, rest = np.random.default_rng(1), 500
    x = np.concatenate((np.zeros(rest), np.linspace(0.0, 100.0, 1000)))
    assert hidden(np.round(x), rest) == 0.5
    assert hidden(np.round(x + rng.normal(size=x.size)), rest) == 0.0
    assert hidden(x + 1e-3 * rng.normal(size=x.size), rest) == 0.0


def pair(gain: float, seed: int) -> list:
    """Single pulses of 12 V and 6 V in noise of 60 mA, which hides that the second current is too large."""
    strong, weak = (coil_record(pulses=(v,), noise=0.06, seed=seed + k) for k, v in enumerate((12.0, 6.0)))
    return [strong, weak._replace(current=gain * weak.current)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [101, 111, 121])  # 1, 11 and 21 were tried
def test_records_that_disagree_beyond_chance_have_errors_that_say_so(seed):
    """Both are explained to their noise; the error was 0.15 % for inductances 3 % apart."""
    both, each = fit_coil(pair(1.03, seed)), [fit_coil([one]).inductance for one in pair(1.03, seed)]
    assert both.is_explained and "air" in both.contrary
    error = both.inductance_error * both.inductance
    assert all(abs(one - both.inductance) < 3.0 * error for one in each), (each, both.inductance, error)
    assert "disagree beyond chance" in " ".join(remarks(both))
    agreeing = fit_coil(pair(1.0, seed))
    assert not agreeing.contrary and agreeing.inductance_error < 2e-3
    assert "disagree" not in " ".join(remarks(agreeing))
