"""Identify and estimate a coil without motion from the command line: measured pulses, as they were recorded."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gapsense._os.files import read_columns
from gapsense.cli import app
from gapsense.identification.measurements.operations import estimate, operations
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.parameter_set import read_values

RECORDS = Path(__file__).parents[1] / "identification" / "records"
TUBE, EMPTY = RECORDS / "tube-150-raw.csv", RECORDS / "empty-162-raw.csv"
SHARE = 0.03  # of the largest flux linkage


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """What the command said of each record, validated with the other one, and the files that it wrote."""

    @cache
    def identify(file):
        set_, figure = (tmp_path_factory.mktemp("coil") / name for name in ("coil.toml", "coil.png"))
        words = ["identify", file, "--out", set_, "--figure", figure, "--validate", EMPTY if file == TUBE else TUBE]
        return CliRunner().invoke(app, [*map(str, words)]), set_, figure

    return identify


def test_one_command_identifies_the_coil_as_it_was_recorded(identified):
    done, set_, figure = identified(TUBE)
    assert (done.exit_code, done.stderr) == (0, "")
    printed = " ".join(done.stdout.split())
    for words in ("No motion", "constant inductance", "taken", "explains the current", "offset is subtracted",
                  "`core.turnover` is not identified", "Validation", "empty-162-raw", "may hide"):  # fmt: skip
        assert words in printed, printed
    assert figure.read_bytes().startswith(b"\x89PNG")
    found = read_values([set_])
    assert found["coil.resistance"] == pytest.approx(0.371, rel=0.01)
    assert found["prior.inductance"] == pytest.approx(337e-6, rel=0.03)


@pytest.mark.parametrize("file", [TUBE, pytest.param(EMPTY, marks=pytest.mark.slow)])
def test_estimators_follow_the_flux_linkage_from_the_first_pulse_on(identified, tmp_path, gapsense, fmus, file):
    done, set_, _ = identified(file)
    assert (done.exit_code, done.stderr) == (0, "")
    options = ["--parameters", set_, "--fmus", fmus, "--figure", tmp_path / "e.png"]
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
