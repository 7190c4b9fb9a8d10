"""Fit of the core of the reduced model: recovers what made the record, and knows how well."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_code import driven
from scipy.signal import lfilter

from gapsense.actuators import solenoid_valve
from gapsense.estimators.reduced_model import current, gap_law, normalise_model
from gapsense.fmi.components import kernel_parameters
from gapsense.scenarios.soft_landing import core_fit as fit
from gapsense.scenarios.soft_landing.core_fit import (
    PUBLISHED,
    fit_core,
    integrated_flux,
    of_reference_cycle,
    standard_errors,
)
from gapsense.studies.devices import VALVE

FMUS = Path(__file__).parents[2] / "fmus"
PAR = kernel_parameters(FMUS / "ekf", {})
MODEL = normalise_model(PAR)
Record = tuple[np.ndarray, np.ndarray, np.ndarray]


def record(m: Any, count: int = 400) -> Record:
    """Position, flux linkage and current of the reduced model along a smooth cycle, up to 97 % of saturation."""
    phase = np.linspace(0.0, 2.0 * np.pi, count)
    z, lam = 0.5 + 0.5 * np.cos(phase), 0.485 * m.lam_sat * (1.0 - np.cos(phase))
    i = [current(gap_law(float(a), m)[0], float(b), 0.0, m) for a, b in zip(z, lam)]
    return m.z_min + m.l_z * z, lam, np.array(i)


@pytest.mark.parametrize(("R_c0", "lam_sat"), [(1.75, 0.0238), (0.6, 0.031), (5.0, 0.02)])
def test_recovers_the_core_that_made_the_record(R_c0: float, lam_sat: float) -> None:
    found = fit_core(*record(MODEL._replace(R_c0=R_c0, lam_sat=lam_sat)), MODEL)
    assert found.reluctance == pytest.approx(R_c0, rel=1e-9) and found.saturation == pytest.approx(lam_sat, rel=1e-9)
    assert found.rms < 1e-10 and found.reluctance_std < 1e-9 and found.samples == 400
    assert found.model(MODEL) == MODEL._replace(R_c0=found.reluctance, lam_sat=found.saturation)


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_standard_errors_are_those_of_many_records(memory: float) -> None:
    """With white noise, and with noise whose neighbours are alike."""
    rng, (z, lam, i) = np.random.default_rng(1), record(MODEL)
    fits = []
    for _ in range(60):
        white = rng.standard_normal(i.size) * np.r_[1.0, np.full(i.size - 1, np.sqrt(1.0 - memory**2))]
        noise = lfilter([1.0], [1.0, -memory], white)
        fits.append(fit_core(z, lam, i + 2e-3 * noise, MODEL))
    for name in ("reluctance", "saturation"):
        spread = np.std([getattr(f, name) for f in fits])
        told = np.median([getattr(f, f"{name}_std") for f in fits])
        assert 0.6 * spread < told < 1.5 * spread, (name, spread, told)
    assert np.mean([f.reluctance for f in fits]) == pytest.approx(MODEL.R_c0, rel=0.02)


def test_white_noise_has_the_classical_standard_errors() -> None:
    rng = np.random.default_rng(2)
    J, r = rng.standard_normal((5000, 2)), 0.3 * rng.standard_normal(5000)
    classical = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * np.sum(r**2) / 4998)
    assert standard_errors(J, r) == pytest.approx(classical, rel=0.05)


def test_record_without_flux_tells_nothing() -> None:
    z = MODEL.z_min + MODEL.l_z * np.linspace(0.0, 1.0, 50)
    found = fit_core(z, np.zeros(50), np.zeros(50), MODEL)
    assert found.reluctance_std == found.saturation_std == np.inf


def test_measured_record_of_the_valve_gives_the_valves_core() -> None:
    """Its core law is that of the reduced model; the flux linkage comes from voltage and current."""
    dt = 20e-6
    voltage = np.where((np.arange(1000) > 50) & (np.arange(1000) < 550), 30.0, 0.0)
    position, i, true = driven(solenoid_valve, VALVE, voltage, dt, "position", "current", "flux_linkage").T
    lam = integrated_flux(dt * np.arange(1000), voltage, i, VALVE.coil_resistance, held=True)
    assert np.abs(lam - true).max() < 1e-3 * np.abs(true).max()
    device = {"coil.turns": VALVE.coil_turns, "gap.slope": VALVE.gap_slope, "gap.fringing": 0.0, "gap.window": 0.1}
    stops = {"stop.lower": VALVE.stop_lower, "stop.upper": VALVE.stop_upper}
    m = normalise_model(kernel_parameters(FMUS / "ekf", {**device, **stops}))
    assert fit_core(position, true, i, m).rms < 1e-9
    found = fit_core(position, lam, i, m)
    assert found.reluctance == pytest.approx(VALVE.core_reluctance / VALVE.coil_turns**2, rel=0.02)
    assert found.saturation == pytest.approx(VALVE.core_saturation, rel=0.005)


def test_flux_of_straight_voltages_is_their_trapezoid() -> None:
    t = np.linspace(0.0, 1.0, 101)
    found = integrated_flux(t, 2.0 * t, np.ones(101), 0.5, held=False)
    assert found == pytest.approx(t**2 - 0.5 * t, abs=1e-12)
    held = integrated_flux(t, np.full(101, 3.0), np.zeros(101), 0.5, held=True)
    assert held == pytest.approx(3.0 * t, abs=1e-12)


@pytest.mark.parametrize("between", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_reference_cycle_of_the_complete_model(between: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simpler models are fitted better; all leave less than the published core does beside our gap law."""
    chosen = [*fit.SIMPLER.items()]
    monkeypatch.setattr(fit, "SIMPLER", dict(chosen if between else (*chosen[:2], chosen[-1])))
    fits = of_reference_cycle(PAR)
    complete, motion, *_, simplest = (f.fit for f in fits)
    assert complete.reluctance == pytest.approx(1.40, abs=0.02)
    assert complete.saturation == pytest.approx(24.7e-3, rel=0.01)
    assert simplest.rms < 0.3 * complete.rms and motion.samples == pytest.approx(400, abs=3)
    assert all(f.fit.rms < f.published_rms for f in fits)
    assert (MODEL.R_c0, MODEL.lam_sat) == pytest.approx((PUBLISHED["R_c0"], PUBLISHED["lam_sat"]))


@pytest.mark.parametrize("sizes", [(20, 19, 20), (20, 20, 21), (4, 4, 4)])
def test_wrong_shapes_are_refused(sizes: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="expected equal"):
        fit_core(*(np.zeros(n) for n in sizes), MODEL)


def test_values_that_are_not_finite_are_refused() -> None:
    z, lam, i = record(MODEL)
    with pytest.raises(ValueError, match="not finite"):
        fit_core(z, lam, np.where(np.arange(i.size) == 7, np.nan, i), MODEL)


def test_parameters_of_a_component_are_its_start_values_but_for_those_given() -> None:
    assert (PAR.gap_law, PAR.damping, len(PAR.gap_file_gap), PAR.option_force_error) == (0.0, 0.8, 29, 1.0)
    changed = kernel_parameters(FMUS / "ekf", {"gap.law": "table", "damping": 1})
    assert changed == PAR._replace(gap_law=1.0, damping=1.0)


def test_all_wrong_parameters_are_told_at_once() -> None:
    wrong = {"coil.resistence": 1.0, "mover.mass": -1.0, "gap.law": "cubic", "gap.file": "no.csv", "damping": "x"}
    with pytest.raises(ValueError) as caught:
        kernel_parameters(FMUS / "ekf", wrong)
    text = str(caught.value)
    for words in ("Did you mean `coil.resistance`", "`mover.mass` is -1.0", "fringing, table", "no.csv", "`damping`"):
        assert words in text, words
