"""Identify and estimate a coil without motion from the command line: measured pulses, as they were recorded."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from gapsense.files import read_columns
from gapsense.studies.identification.coil.fit import identify
from gapsense.studies.identification.transfer import read_values
from gapsense.studies.records.checks import read_record, reading

RECORDS = Path(__file__).parents[1] / "studies" / "records"
TUBE, EMPTY = RECORDS / "tube-150-raw.csv", RECORDS / "empty-162-raw.csv"
SHARE = 0.03  # of the largest flux linkage


def test_one_command_identifies_the_coil_and_estimators_follow_it_from_the_first_pulse_on(tmp_path, gapsense, fmus):
    options = ["--out", tmp_path / "coil.toml", "--figure", tmp_path / "coil.png"]
    done = gapsense("identify", TUBE, *options, "--validate", EMPTY)
    assert (done.exit_code, done.stderr) == (0, "")
    printed = " ".join(done.stdout.split())
    for words in ("No motion", "constant inductance", "taken", "explains the current", "offset is subtracted",
                  "`core.turnover` is not identified", "Validation", "empty-162-raw"):  # fmt: skip
        assert words in printed, printed
    assert (tmp_path / "coil.png").read_bytes().startswith(b"\x89PNG")
    found = read_values([tmp_path / "coil.toml"])
    assert found["coil.resistance"] == pytest.approx(0.371, rel=0.01)
    assert found["prior.inductance"] == pytest.approx(337e-6, rel=0.03)
    offset = re.search(r"--offset (voltage=-[\d.]+)", printed)
    assert offset
    estimate(gapsense, fmus, tmp_path, offset[1])
    model = identify([read_record(TUBE, reading(None, "end"))]).models[0].flux_linkage
    result = read_columns(tmp_path / "e.csv")
    for name in ("Semera", "IntegralEstimator"):
        off = result[f"{name}.flux_linkage"][-model.size :] - model
        flows = result[f"{name}.quality"][-model.size :] > 0.5  # without current both follow the expert rule
        assert flows.sum() > 1000 and np.abs(off[flows]).max() < SHARE * model.max(), name


def estimate(gapsense, fmus, folder, offset):
    options = ["--parameters", folder / "coil.toml", "--fmus", fmus, "--figure", folder / "e.png"]
    more = ["--out", folder / "e.csv", "--offset", offset, "--estimator", "semera,integral_estimator"]
    done = gapsense("estimate", TUBE, *options, *more)
    assert done.exit_code == 0, done.stderr


@pytest.mark.parametrize("offset", ["position=1", "voltage", "voltage=some"])
def test_odd_offset_is_refused(tmp_path, gapsense, offset):
    done = gapsense("estimate", TUBE, "--offset", offset, "--figure", tmp_path / "e.png")
    assert done.exit_code == 2 and f"--offset: `{offset}` found" in done.stderr


def test_coil_is_fitted_on_request_only_where_a_valve_is_named(tmp_path, gapsense):
    done = gapsense("identify", EMPTY, "--model", "solenoid_valve", "--out", tmp_path / "v.toml")
    assert done.exit_code == 2 and "another device" in done.stderr and "coil without motion" not in done.stderr
