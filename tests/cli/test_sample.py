"""The sample record that comes with the package, as a newcomer uses it: by its name, in any folder."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from gapsense._os.files import read_columns
from gapsense.identification.parameter_set import read_sets
from gapsense.identification.valve.show import BY_NAME
from gapsense.shipped import RECORDS, record

MAKER = runpy.run_path(str(RECORDS / "make_sample_valve.py"))
FITTED = ("coil.turns", "core.reluctance", "core.saturation", "mover.mass", "spring.stiffness", "coil.resistance")


@pytest.mark.parametrize("name", MAKER["RECORDS"])
def test_sample_is_what_its_script_makes(name):
    assert MAKER["text"](name) == (RECORDS / f"{name}.csv").read_text(encoding="utf-8")
    assert (RECORDS / f"{name}.csv").stat().st_size < 200_000


def test_known_values_are_those_of_the_simulated_valve():
    values, assumed = read_sets([RECORDS / "sample_valve.toml"])
    assert not assumed and {BY_NAME[name].field for name in values} >= {"stop_lower", "stop_upper", "spring_rest"}
    for name, value in values.items():
        assert value == getattr(MAKER["VALVE"], BY_NAME[name].field), name


def test_a_file_of_that_name_comes_first(tmp_path):
    assert record("sample_valve.csv") == RECORDS / "sample_valve.csv"
    assert record("sample_valve.cvs") == Path("sample_valve.cvs")
    assert record("some/sample_valve.csv") == Path("some/sample_valve.csv")
    assert record("make_sample_valve.py") == Path("make_sample_valve.py")
    Path("sample_valve.csv").touch()
    assert record("sample_valve.csv") == Path("sample_valve.csv")


@pytest.mark.slow
def test_sample_gives_the_valve_and_its_position(gapsense, quickest):
    """Three commands in an empty folder; positions are held against the simulated ones."""
    seen = gapsense("inspect", "sample_valve.csv")
    assert seen.exit_code == 0 and "ready" in seen.stdout and "with care" not in seen.stdout
    known = ("--parameters", "sample_valve.toml", "--validate", "sample_valve_22V.csv", "--out", "mine.toml")
    done = gapsense("identify", "sample_valve.csv", *known)
    assert done.exit_code == 0 and "which is noise" in done.stdout and "not identified" not in done.stdout, done.output
    found, assumed = read_sets([Path("mine.toml")])
    assert not assumed
    for name in FITTED:
        assert found[name] == pytest.approx(getattr(MAKER["VALVE"], BY_NAME[name].field), rel=0.01), name
    options = ("--parameters", "mine.toml", "--estimator", "bounded_ukf,mhe", "--out", "estimates.csv")
    assert gapsense("estimate", "sample_valve.csv", *options, "--fmus", quickest).exit_code == 0
    estimates, true = read_columns(Path("estimates.csv")), MAKER["simulated"](MAKER["RECORDS"]["sample_valve"])[1]
    errors = {name: np.sqrt(np.mean((estimates[f"{name}.position"] - true) ** 2)) for name in ("BoundedUkf", "Mhe")}
    assert errors["BoundedUkf"] < 3e-6 and errors["Mhe"] < 30e-6, errors
