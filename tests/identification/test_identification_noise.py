"""Noise that identify hands on to the estimators."""

from __future__ import annotations

import numpy as np
import pytest
import valve_records as records

from gapsense.identification.parameter_set import parameters_of
from gapsense.identification.residual import noises
from gapsense.problems import InputError
from gapsense.studies.devices import VALVE


@pytest.mark.parametrize(("volts", "amperes"), [(15e-3, 1e-3), (0.2, 10e-3)])
@pytest.mark.parametrize("seed", [1, 2])
def test_noise_is_found(volts, amperes, seed):
    found = noises([records.record(seed=seed, noise=(volts, amperes))])
    assert found["noise.current"] == pytest.approx(amperes, rel=0.15)
    assert found["noise.voltage"] == pytest.approx(volts, rel=0.4) or found["noise.voltage"] == 0.03


def test_noisier_record_counts_and_what_a_converter_hides_is_noise():
    quiet, loud = (records.record(seed=1, noise=(0.1, i)) for i in (1e-3, 5e-3))
    assert noises([quiet, loud])["noise.current"] == pytest.approx(5e-3, rel=0.15)
    step = 0.02
    coarse = quiet._replace(current=step * np.round(quiet.current / step))
    assert noises([coarse])["noise.current"] == pytest.approx(step / np.sqrt(12.0), rel=0.3)


def test_record_without_noise_has_a_little():
    found = noises([records.record()])
    assert found == {"noise.voltage": 0.03, "noise.current": pytest.approx(1e-3 * 0.387, rel=0.05)}


def test_voltage_that_is_switched_often_is_not_noise():
    quiet = records.record(seed=1)
    switched = np.where((quiet.voltage > 15.0) & (np.arange(quiet.times.size) % 2 == 0), 0.0, quiet.voltage)
    assert noises([quiet._replace(voltage=switched)])["noise.voltage"] <= 0.031


def test_set_with_noise_describes_the_valve_all_the_same(tmp_path):
    file = tmp_path / "valve.toml"
    file.write_text('[values]\n"coil.turns" = 1100\n"noise.current" = 1e-3\n"core.eddy" = 1e-4\n', encoding="utf-8")
    assert parameters_of("solenoid_valve", file) == VALVE._replace(coil_turns=1100.0)


@pytest.mark.parametrize(("name", "hint"), [("noise.curent", "Remove it"), ("mover.mas", "mover.mass")])
def test_name_that_nobody_has_is_refused(tmp_path, name, hint):
    file = tmp_path / "valve.toml"
    file.write_text(f'[values]\n"{name}" = 1e-3\n', encoding="utf-8")
    with pytest.raises(InputError, match=rf"valve.toml: .*{name}.*{hint}"):
        parameters_of("solenoid_valve", file)


def test_gap_law_of_another_model_is_not_left_out_in_silence(tmp_path):
    file = tmp_path / "valve.toml"
    file.write_text('[values]\n"gap.fringing" = 300.0\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"gap\.fringing"):
        parameters_of("solenoid_valve", file)
