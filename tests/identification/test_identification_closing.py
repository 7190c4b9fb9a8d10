"""A closing alone: the coil stays on, and the record ends; seeds 1, 2 and 100 to 115 tried it before."""

from __future__ import annotations

import numpy as np
import pytest
from imperfect_records import Condition, record
from valve_records import GUESS

from gapsense.identification.causes import BESIDE
from gapsense.identification.coil.fit import fit_coil
from gapsense.identification.measurements.checks import operation_problems
from gapsense.identification.measurements.hum import hum
from gapsense.identification.measurements.operations import Operation, estimate, operations
from gapsense.identification.measurements.record import Columns, part, to_record
from gapsense.identification.measurements.signals import noise
from gapsense.identification.residual import verdict
from gapsense.identification.valve.fit import fit_valve
from gapsense.identification.valve.form import Sought, value_of
from gapsense.identification.valve.show import remarks
from gapsense.studies.devices import VALVE


def closing(seed: int, volts: float = 30.0, on: float = 14e-3):
    return record(Condition(on=on, period=on), volts, 1, np.random.default_rng(seed))


def test_coil_that_is_held_until_all_has_settled_has_operated():
    held = closing(30)
    (found,) = operations(held)
    assert found.held and held.times[found.stop] == held.times[-1] and not [*operation_problems(held, "x.csv", None)]
    assert estimate(held, [found]).resistances[0] == pytest.approx(76.0, rel=2e-3)
    early = part(held, slice(0, 75))  # just after the landing, while the current rises
    assert not operations(early)
    (said,) = operation_problems(early, "x.csv", None)
    assert "settled while the coil is held" in said and "`gapsense commission`" in said


@pytest.mark.parametrize("seed", range(200, 206))
def test_closings_alone_give_the_valve_within_stated_errors(seed):
    """Two single shots: RMS of errors over stated ones 1.00 in 16 others, 5 % beyond two."""
    result = fit_valve([closing(seed), closing(seed + 50, 24.0)], GUESS, 1, sought=Sought(()))
    errors = zip(result.names, result.uncertainty.relative)
    known = [(name, error) for name, error in errors if name not in result.poor]
    off = {name: (float(value_of(result.parameters, name)) / getattr(VALVE, name) - 1.0) / e for name, e in known}
    assert result.is_explained and len(off) >= 5 and {"coil_resistance", "mover_mass"} < {*off}
    assert max(map(abs, off.values())) < 3.5, off
    assert result.uncertainty.relative[-1] < 1e-3


def test_record_that_ends_while_the_coil_is_held_again_is_used_to_its_end():
    whole = record(Condition(), 30.0, 3, np.random.default_rng(31))
    cut = part(whole, slice(0, 30 + round(36.5e-3 / whole.dt)))
    assert [o.held for o in operations(cut)] == [0, 0] and not [*operation_problems(cut, "x.csv", None)]
    result = fit_valve([cut], VALVE, 1, sought=Sought(()))
    assert result.is_explained and result.models[0].current.size == cut.times.size - operations(cut)[0].start + BESIDE


def test_coil_without_motion_that_is_held_is_a_coil():
    k, dt, L, R = np.arange(700), 50e-6, 0.05, 76.0
    volts = np.where(k >= 30, 30.0, 0.0)
    means, current = 0.5 * (volts + np.append(0.0, volts[:-1])), np.zeros(k.size)
    for j in range(1, k.size):
        current[j] = (dt * means[j] + (L - 0.5 * R * dt) * current[j - 1]) / (L + 0.5 * R * dt)
    noises = np.random.default_rng(32).standard_normal((2, k.size))
    values = {"time": dt * k, "voltage": volts + 15e-3 * noises[0], "current": current + 1e-3 * noises[1]}
    found = fit_coil([to_record(Columns("held.csv", k, values))])
    assert found.is_explained and found.inductance == pytest.approx(L, rel=4.0 * found.inductance_error)
    assert float(found.parameters.resistance) == pytest.approx(R, rel=1e-3)


def test_operation_of_a_held_coil_is_balanced_where_it_has_settled():
    assert Operation(10, 100).balanced == slice(11, 101)
    assert Operation(10, 100, 20).balanced == slice(81, 101)


def test_hum_while_the_coil_is_held_is_named_where_the_coil_hardly_rests():
    """It was no complete operation, since the current did not settle."""
    held = record(Condition(on=32e-3, period=32e-3, hum=3e-3, dt=100e-6), 30.0, 1, np.random.default_rng(41))
    (said,) = operation_problems(held, "x.csv", None)
    assert "goes with 50 Hz: hum of the mains" in said
    assert operations(closing(42, on=32e-3)) and hum(closing(42, on=32e-3)) is None
    unsettled = part(closing(43, on=32e-3), slice(0, 75))
    assert "no complete operation" in " ".join(operation_problems(unsettled, "x.csv", None))


@pytest.mark.parametrize(
    ("by", "words"), [({"drift": 3e-3}, "is held it rises steadily"), ({"warming": 0.01}, "is held it falls steadily")]
)
def test_current_that_creeps_while_the_coil_is_held_is_named(by, words):
    """A drop of the driver was named first."""
    held = record(Condition(on=30e-3, period=30e-3, noise=0.3, **by), 30.0, 1, np.random.default_rng(44))
    result = fit_valve([held], GUESS, 1, sought=Sought(()))
    (left,) = result.residuals
    said = verdict(left, "", "")
    assert not result.is_explained
    assert words in said and "a zero of the current that drifts" in said and "drops" not in said


def test_coarse_voltage_is_noise_of_the_current_of_the_model_too():
    """Its steps were taken for a model that does not explain the record: 1.7 times the noise."""
    held = record(Condition(on=30e-3, period=30e-3, noise=0.3), 30.15, 1, np.random.default_rng(45))
    values = {"time": held.times, "voltage": np.round(held.voltage / 0.3) * 0.3, "current": held.current}
    coarse = to_record(Columns("coarse.csv", np.arange(held.times.size) + 2, values), "trapezoid")
    (left,) = fit_valve([coarse], VALVE, 1, sought=Sought(())).residuals
    assert left.is_explained and left.rms > 1.25 * noise(coarse.current), left


def test_core_that_hardly_saturates_is_found_from_any_guess():
    """With five times the guess at most, hundreds of noises were left."""
    par = VALVE._replace(core_saturation=0.6)
    condition = Condition(par=par, noise=0.2, on=10e-3, period=40e-3)
    shots = [record(condition, volts, 1, np.random.default_rng(46)) for volts in (30.0, 24.0)]
    result = fit_valve(shots, par._replace(core_saturation=0.02), 1, sought=Sought(()))
    high = np.where(np.isin(result.form.fitted, "core_saturation"), result.form.limits[1], result.ratios)
    told = [" ".join(remarks(result._replace(ratios=ratios))) for ratios in (result.ratios, high)]
    assert result.is_explained and ["show no saturation" in said for said in told] == [False, True]
    assert not any("`core.saturation` ends at a limit" in said for said in told)
    for name in ("mover_mass", "coil_turns", "core_reluctance"):
        assert float(value_of(result.parameters, name)) == pytest.approx(getattr(par, name), rel=0.03)
