"""Whether estimates can be right, by what the record itself tells."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense.fmi.components import components_folder
from gapsense.identification import estimate as judge
from gapsense.identification import estimate as run
from gapsense.identification.estimate import run_estimator
from gapsense.identification.measurements.record import Columns, part, to_record
from gapsense.identification.valve.model import simulate
from gapsense.identification.valve.show import PORTS
from gapsense.studies.devices import VALVE

DT, REST, PERIOD = 20e-6, 40, 1000
MINE = [port for port in PORTS.values() if hasattr(VALVE, port.field) and "gap" not in port.name]
GIVEN = {"gap.law": "linear", **{port.name: getattr(VALVE, port.field) for port in MINE}}
GIVEN = {name: value for name, value in GIVEN.items() if "micro" not in name} | {"gap.slope": VALVE.gap_slope}
OTHER = VALVE._replace(coil_turns=600.0, coil_resistance=30.0)
ALL = ["BoundedUkf", "Ekf", "Ertss", "Mhe", "Semera", "IntegralEstimator"]


def record(par, volts=30.0, on=300, seed=1, noise=1e-3, periods=3):
    """Pulses of so many samples, as a drive holds them, with the modes of the mover."""
    k = np.arange(REST + periods * PERIOD)
    u = np.where((k > REST) & ((k - REST - 1) % PERIOD < on), volts, 0.0)
    run = simulate(par, np.stack((u, u), axis=1), DT, np.full(k.size, par.coil_resistance))
    mode = np.where(run.position <= par.stop_lower, 1.0, np.where(run.position >= par.stop_upper, 3.0, 2.0))
    rng = np.random.default_rng(seed)
    i, v = run.current + noise * rng.standard_normal(k.size), u + 15.0 * noise * rng.standard_normal(k.size)
    return to_record(Columns("x.csv", k, {"time": DT * k, "voltage": v, "current": i, "mode": mode}), "end")


def verdicts(fmus, measured, names, values):
    told = judge.truth(measured)
    return [judge.verdict(told, run_estimator(fmus / f"{name}.fmu", measured, values)) for name in names]


@pytest.mark.parametrize(
    ("volts", "on", "seed", "noise"),
    [
        (24.0, 400, 1, 1e-3),
        pytest.param(30.0, 300, 2, 3e-4, marks=pytest.mark.slow),
        pytest.param(42.0, 200, 3, 4e-3, marks=pytest.mark.slow),
    ],
)
def test_sound_estimates_are_silent(fmus, volts, on, seed, noise):
    values = {**GIVEN, "noise.current": noise, "noise.voltage": 15.0 * noise}
    assert verdicts(fmus, record(VALVE, volts, on, seed, noise), ALL, values) == [""] * len(ALL)


def test_another_device_is_told_by_each_estimator_that_models_it(fmus):
    found = verdicts(fmus, record(OTHER), ["BoundedUkf", "Ekf", "Ertss", "Mhe", "HybridEkf"], GIVEN)
    for sentence in found[:4]:
        assert "`coil.resistance` is 76 Ohm, that of the record 30" in sentence and "gapsense identify" in sentence
    assert "HybridEkf: " in found[4]


def test_core_that_saturates_earlier_is_told(fmus):
    found = verdicts(fmus, record(VALVE._replace(core_saturation=0.018)), ["BoundedUkf", "Ekf"], GIVEN)
    assert all("off that of the record, (21)" in text for text in found)
    assert all("gapsense inspect" in text for text in found)


def test_learnt_resistance_that_is_not_the_records_is_told(fmus):
    measured = record(VALVE)
    estimate = run_estimator(fmus / "Semera.fmu", measured, GIVEN)
    far = estimate._replace(outputs={**estimate.outputs, "resistance": 0.5 * estimate.outputs["resistance"]})
    said = judge.verdict(judge.truth(measured), far)
    assert "its resistance is 38" in said and "(23), 7" in said and "another device" not in said


def test_without_a_complete_operation_the_current_decides(fmus):
    cut = record(OTHER, on=2000, periods=1)
    (said,) = verdicts(fmus, cut, ["BoundedUkf"], GIVEN)
    assert "of the current unexplained" in said and "(21)" not in said


def test_mhe_that_has_solved_no_window_is_told_whatever_its_health(fmus):
    measured = record(VALVE)
    estimate = run_estimator(fmus / "Mhe.fmu", measured, GIVEN)
    idle = {"windows": 0.0 * measured.times, "innovation": 0.03 + 0.0 * measured.times}
    far = estimate._replace(outputs={**estimate.outputs, **idle, "health": 1.0 + 0.0 * measured.times})
    said = judge.verdict(judge.truth(measured), far)
    assert "it has not solved one window" in said and "times the noise, whatever its `health` says" in said


@pytest.mark.parametrize("step", [0.0, 0.2, 0.5])
def test_white_noise_however_coarse_is_no_operation(step):
    rng, n = np.random.default_rng(5), 5000
    v, i = 30.0 * rng.standard_normal(n), 0.15 * rng.standard_normal(n)
    i = np.round(i / step) * step if step else i
    measured = to_record(Columns("x.csv", np.arange(n), {"time": DT * np.arange(n), "voltage": v, "current": i}), "end")
    (said,) = judge.doubts(measured, [])
    assert "no estimate can be judged" in said


def test_estimator_that_does_not_take_the_sampling_is_left_out_with_a_word():
    fast = record(VALVE, periods=1)
    fast = fast._replace(times=fast.times / 4.0)
    found = run.estimators(components_folder())
    names, left_out = run.choose_estimators(None, found, fast, GIVEN)
    assert "Semera" in names and "Mhe" not in names
    assert any(text.startswith("Mhe, every 5 us: `window.longest`") for text in left_out)
    with pytest.raises(ValueError, match="every 5 us"):
        run.choose_estimators("mhe", found, fast, GIVEN)


def test_record_that_is_too_fast_for_an_estimator_is_read_as_means(fmus):
    """A window of `Mhe` has at most 2000 samples: a sound record of 5 us was refused."""
    found, slow = run.estimators(components_folder()), record(VALVE, periods=3)
    k = np.arange(4 * slow.times.size - 3)
    volts, current = slow.voltage[-(-k // 4)], np.interp(0.25 * k, np.arange(slow.times.size), slow.current)
    fast = to_record(Columns("x.csv", k, {"time": 0.25 * DT * k, "voltage": volts, "current": current}), "end")
    made = run.coarsen(fast, "mhe", found, GIVEN)
    assert made.dt == pytest.approx(2 * fast.dt) and "means of 2 samples, every 10 us" in made.remarks[-1]
    assert run.choose_estimators("mhe", found, made, GIVEN) == (["Mhe"], [])
    assert run.coarsen(fast, "semera", found, GIVEN) is fast and run.coarsen(slow, "mhe", found, GIVEN) is slow
    of_fast, of_slow = (run_estimator(fmus / "Mhe.fmu", r, GIVEN) for r in (made, slow))
    assert of_fast.values["option.mean"] is True and "option.mean" not in of_slow.values
    volts = np.round(slow.voltage / 30.0) * 30.0
    true = simulate(VALVE, np.stack((volts, volts), axis=1), DT, np.full(volts.size, VALVE.coil_resistance)).position
    moved = np.interp(slow.times, made.times, of_fast.outputs["position"])
    errors = [np.sqrt(np.mean((z - true) ** 2)) for z in (moved, of_slow.outputs["position"])]
    assert errors[0] < errors[1] < 50e-6, errors


def test_what_judges_another_estimator_is_none_of_a_record():
    found = run.estimators(components_folder())
    _, left_out = run.choose_estimators(None, found, record(VALVE, periods=1), GIVEN)
    assert {"Ekf", "Mhe", "HybridEkf"} < {*found} and not any("Monitor" in text for text in left_out)


def test_estimators_of_a_mover_are_left_out_for_a_coil():
    coil = {"coil.resistance": 0.37, "prior.inductance": 3e-4, "noise.current": 2.0}
    names, left_out = run.choose_estimators(None, run.estimators(components_folder()), record(VALVE, periods=1), coil)
    assert names == ["IntegralEstimator", "Semera"]
    assert "BoundedUkf models a mover, which the parameters of a coil do not describe." in left_out[0]


def test_reversed_sensor_is_told_once():
    measured = record(VALVE)
    (said,) = judge.doubts(measured._replace(current=-measured.current), [])
    assert "opposite signs" in said and "would be -7" in said


def test_record_that_does_not_begin_at_rest_is_no_truth():
    measured = part(record(VALVE), slice(REST + 100, None))
    told = judge.truth(measured)
    assert told.resistance is None and told.flux_linkage is None


def test_output_says_why_an_estimator_does_not_trust_itself(fmus):
    """A single pulse teaches `Mhe` nothing that it could prove: its health is 0 in all of it."""
    measured = record(VALVE, periods=1)
    text = judge.trust(run_estimator(fmus / "Mhe.fmu", measured, GIVEN))
    assert text == "Mhe: `health` is 1 in 3.9 % of the samples; 0 for: device not learnt yet, operate it twice (96 %)."
    assert measured.times.size > 700 and "No window was solved" not in text
    cut = part(measured, slice(0, 200))
    short = run_estimator(fmus / "Mhe.fmu", cut, GIVEN)
    assert "No window was solved" in judge.trust(short) and short.outputs["impact_speed"][-1] == 0.0
    for axis in judge.estimate_figure(cut, [short]).axes:  # nothing that is smoothed, in no legend either
        assert not any("smoothed" in label for label in axis.get_legend_handles_labels()[1])
