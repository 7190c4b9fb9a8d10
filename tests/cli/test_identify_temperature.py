"""`gapsense identify` of records at several temperatures."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "identification"))

from valve_records import write

from gapsense.studies.devices import VALVE


@pytest.fixture
def hot_and_cold(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for k, T in enumerate((20.0, 60.0)):
        par = VALVE._replace(coil_resistance=76.0 * (1.0 + 3.93e-3 * (T - 20.0)))
        write(tmp_path / f"at{T:g}.csv", par=par, periods=1, seed=k)
    known = '[values]\n"stop.lower" = 0.0\n"stop.upper" = 0.9e-3\n"spring.rest" = 22.5e-3\n"gap.slope" = 2.7e10\n'
    (tmp_path / "known.toml").write_text(known, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_command_tells_the_coefficient_and_notes_it_in_the_set(gapsense, hot_and_cold):
    options = ["--temperature", "20,60", "--parameters", "known.toml", "--starts", "1"]
    done = gapsense("identify", "at20.csv", "at60.csv", *options)
    assert done.exit_code == 0, done.output
    said = " ".join(done.stdout.split())
    alpha, error = map(float, re.search(r"temperature coefficient is ([\d.]+) \+- ([\d.e-]+) 1/K", said).groups())
    assert abs(alpha - 3.93e-3) < 3.0 * error < 3e-4
    text = Path("valve.toml").read_text("utf-8")
    assert "# The resistance is 7" in text and "# `coil.resistance` is the mean of all records" in text


def test_command_refuses_temperatures_that_tell_nothing(gapsense, hot_and_cold):
    done = gapsense("identify", "at20.csv", "at60.csv", "--temperature", "20,25")
    assert done.exit_code == 2 and "5 K from the coldest to the hottest record are too few" in done.stderr
    assert not Path("valve.toml").exists()
