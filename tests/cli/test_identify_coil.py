"""Identify and estimate a coil without motion from the command line: measured pulses, as they were recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense._os.files import read_columns
from gapsense.identification.measurements.operations import estimate, operations
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.parameter_set import read_values

RECORDS = Path(__file__).parents[1] / "identification" / "records"
TUBE, EMPTY = RECORDS / "tube-150-raw.csv", RECORDS / "empty-162-raw.csv"
SHARE = 0.03  # of the largest flux linkage


def test_one_command_identifies_the_coil_as_it_was_recorded(tmp_path, gapsense):
    options = ["--out", tmp_path / "coil.toml", "--figure", tmp_path / "coil.png"]
    done = gapsense("identify", TUBE, *options, "--validate", EMPTY)
    assert (done.exit_code, done.stderr) == (0, "")
    printed = " ".join(done.stdout.split())
    for words in ("No motion", "constant inductance", "taken", "explains the current", "offset is subtracted",
                  "`core.turnover` is not identified", "Validation", "empty-162-raw", "may hide"):  # fmt: skip
        assert words in printed, printed
    assert (tmp_path / "coil.png").read_bytes().startswith(b"\x89PNG")
    found = read_values([tmp_path / "coil.toml"])
    assert found["coil.resistance"] == pytest.approx(0.371, rel=0.01)
    assert found["prior.inductance"] == pytest.approx(337e-6, rel=0.03)


@pytest.mark.parametrize("file", [TUBE, pytest.param(EMPTY, marks=pytest.mark.slow)])
def test_estimators_follow_the_flux_linkage_from_the_first_pulse_on(tmp_path, gapsense, fmus, file):
    done = gapsense("identify", file, "--out", tmp_path / "coil.toml")
    assert (done.exit_code, done.stderr) == (0, "")
    options = ["--parameters", tmp_path / "coil.toml", "--fmus", fmus, "--figure", tmp_path / "e.png"]
    more = ["--out", tmp_path / "e.csv", "--estimator", "semera,integral_estimator"]
    done = gapsense("estimate", file, *options, *more)
    assert done.exit_code == 0, done.stderr
    record, result = read_record(file), read_columns(tmp_path / "e.csv")
    flux_linkage = estimate(record, operations(record)).flux_linkage
    for name in ("Semera", "IntegralEstimator"):
        off, flows = result[f"{name}.flux_linkage"] - flux_linkage, result[f"{name}.quality"] > 0.5
        assert flows.sum() > 1000 and np.abs(off[flows]).max() < SHARE * flux_linkage.max(), name  # or the expert rule


@pytest.mark.parametrize("offset", ["position=1", "voltage", "voltage=some"])
def test_odd_offset_is_refused(tmp_path, gapsense, offset):
    done = gapsense("estimate", TUBE, "--offset", offset, "--figure", tmp_path / "e.png")
    assert done.exit_code == 2 and f"--offset: `{offset}` found" in done.stderr


def test_coil_is_fitted_on_request_only_where_a_valve_is_named(tmp_path, gapsense):
    known = '[values]\n"stop.lower" = 0.0\n"stop.upper" = 1e-3\n"spring.rest" = 20e-3\n"gap.slope" = 2.7e10\n'
    (tmp_path / "known.toml").write_text(known, encoding="utf-8")
    options = ["--parameters", tmp_path / "known.toml", "--out", tmp_path / "v.toml"]
    done = gapsense("identify", EMPTY, "--model", "solenoid_valve", *options)
    assert done.exit_code == 2 and "another device" in done.stderr and "coil without motion" not in done.stderr
