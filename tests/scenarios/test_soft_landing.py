"""The soft-landing voltage in the drive: the actuator follows the trajectory through the FMUs."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gapsense import cosim
from gapsense.fmi.tables import read_table
from gapsense.scenarios.soft_landing import cycle
from gapsense.scenarios.soft_landing.reference import process_noise
from gapsense.scenarios.soft_landing.setting import nominal, unvaried
from gapsense.scenarios.soft_landing.show import LABELS, smoothed
from gapsense.scenarios.soft_landing.table import deviation, voltage_table, write
from gapsense.scenarios.soft_landing.trajectory import FIG_5
from gapsense.studies import drawer
from gapsense.studies.devices import RTS_VALVE

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
WIDE = {"stop.lower": 0.2e-3, "stop.upper": 1.6e-3, "initial.position": 1.6e-3, "spring.stiffness": 100.0}
SCENARIO = """
title = "Soft landing"
[experiment]
start = 0.0
stop = {stop}
base_step = {step}
method = "gauss-seidel"
[components.drive]
fmu = "DriveVoltage"
set = {{ {drive} }}
[components.actuator]
fmu = "ReluctanceActuator"
set = {{ {actuator} }}
[[connections]]
from = "drive.voltage_mean"
to = "actuator.voltage"
[inputs]
"drive.enable" = 1.0
"drive.reference" = 0.0
[record]
signals = ["actuator.position", "actuator.mode", "actuator.velocity", "drive.voltage"]
"""


@pytest.fixture(scope="module")
def fmus(natives):
    """Native ones, which have the bits of the Python ones in all scenarios: tests/native/test_scenarios.py."""
    return natives


def entries(values):
    return ", ".join(f'"{name}" = {value!r}'.replace("'", '"') for name, value in values.items())


def run(folder, fmus, stop, step, drive=None, actuator=None):
    text = SCENARIO.format(
        stop=stop,
        step=step,
        drive=entries({"waveform": "soft_landing", **(drive or {})}),
        actuator=entries(actuator or {}),
    )
    (folder / "scenario.toml").write_text(text, encoding="utf-8")
    return cosim.run(folder, None, fmus)


@pytest.fixture(scope="module")
def cycles():
    return cycle.soft_landing(RTS_VALVE, FIG_5, 2e-6, 2)


@pytest.mark.parametrize(("step", "limit"), [pytest.param(2e-6, 3e-9, marks=pytest.mark.slow), (5e-6, 1e-8)])
def test_built_in_cycles_are_followed_again_and_again(tmp_path, fmus, cycles, step, limit):
    result = run(tmp_path, fmus, 80e-3, step)
    repeated = [*cycles, cycles[1], cycles[1]]
    assert deviation(repeated, result.times, result.signals["actuator.position"]) < limit
    changes = np.flatnonzero(np.diff(result.signals["actuator.mode"]))
    # each of the 16 contacts and releases once or, where the landing comes a nanometre early, some times more
    assert changes.size >= 16
    near = np.array([1e-3, 5e-3, 11e-3, 15e-3])
    assert all(np.abs(near - t % 20e-3).min() < 50e-6 for t in result.times[changes])


def test_table_of_another_actuator_is_followed(tmp_path, fmus):
    trajectory = FIG_5._replace(making_duration=5e-3, breaking_start=13e-3, hold_voltage=25.0)
    par = RTS_VALVE._replace(**{name.replace(".", "_"): value for name, value in WIDE.items()})
    cycles = cycle.soft_landing(par, trajectory, 2e-6, 2)
    write(tmp_path / "drive.csv", *voltage_table(cycles))
    result = run(tmp_path, fmus, 60e-3, 2e-6, {"soft_landing.file": "drive.csv"}, WIDE)
    assert deviation([*cycles, cycles[1]], result.times, result.signals["actuator.position"]) < 1e-8


def test_built_in_table_is_what_the_study_makes(cycles):
    times, voltages = voltage_table(cycles)
    found = read_table(ROOT / "fmus" / "drive_voltage" / "soft_landing.csv", ("time", "voltage"))
    assert found[0] == pytest.approx(times, abs=1e-12)
    assert found[1] == pytest.approx(voltages, abs=1e-8)
    assert len(found[0]) < 500


# The scenario ---------------------------------------------------------------------------------------------------------


FOLDER = ROOT / "scenarios" / "soft_landing"


@pytest.fixture(scope="module")
def result(fmus):
    return cosim.run(FOLDER, None, fmus)


def test_estimators_know_what_table_ii_says_and_the_process_noise_of_the_cycle(cycles):
    model = nominal()
    samples = cycle.sampled(cycles[1], model.T_s)
    values = tomllib.loads((FOLDER / "parameters" / "estimators.toml").read_text(encoding="utf-8"))["values"]
    assert values["core.reluctance"] == pytest.approx(model.R_c0 * 1200.0**2)
    assert values["core.saturation"] == model.lam_sat
    noise = np.sqrt(process_noise(samples, unvaried(model), model)) / [1.0, 1.0, 1.0, 1.0, model.l_z]
    names = ("process.flux_linkage", "process.current_error", "process.force_error")
    assert [values[name] for name in names] == pytest.approx(noise[2:], rel=1e-3)


def test_smoothed_values_are_put_back_to_their_times(result):
    for name in ("ertss", "no_current_error", "no_force_error"):
        s = smoothed(result, name, "position")
        assert np.all(np.diff(s.time) > 0.0)
        assert s.time.size > 4 * 195  # both motions of both cycles
        late = result[f"{name}.smoothed_published"] > 0.5
        assert np.all(result.times[late] - result[f"{name}.smoothed_time"][late] > 4e-3)
    aligned = np.sum((s.values - s.truth) ** 2)  # of the smoother with the smallest error
    for shift in (-1, 1):
        assert np.sum((s.values[1:-1] - np.roll(s.truth, shift)[1:-1]) ** 2) > 2.0 * aligned


def test_orderings_of_the_paper_come_out(result):
    value = {name: m.value for name, m in result.metrics.items()}
    for quantity in ("position", "velocity"):
        for operation in ("making", "breaking"):
            ertss = value[f"ertss_{quantity}_{operation}"]
            assert ertss < value[f"no_current_error_{quantity}_{operation}"] < value[f"ekf_{quantity}_{operation}"]
            assert value[f"no_force_error_{quantity}_{operation}"] < ertss  # with right parameters


def test_figure_shows_cycles_and_errors(result):
    drawn = drawer("soft_landing")(result)
    assert [axis.get_ylabel() for axis in drawn.axes] == LABELS
    _, labels = drawn.axes[3].get_legend_handles_labels()
    assert labels == ["EKF", "ERTSS", "without e_i", "without e_F"]
    truth = drawn.axes[2].lines[1].get_ydata()
    assert (truth.min(), truth.max()) == pytest.approx((0.4, 1.4))


def test_figure_names_what_is_not_recorded(result):
    less = replace(result, signals={n: v for n, v in result.signals.items() if n != "ertss.smoothed_time"})
    with pytest.raises(ValueError, match=r"`ertss\.smoothed_time`"):
        drawer("soft_landing")(less)
