"""`gapsense gap-law`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense.identification.parameter_set import parameters_of, read_sets, read_values

TABLE = Path(__file__).resolve().parents[1] / "identification" / "records" / "takaha-inductance.csv"


@pytest.mark.slow
def test_command_writes_a_set_that_the_valve_takes(gapsense, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("known.toml").write_text('[values]\n"stop.upper" = 4e-3\n"gap.slope" = 1e9\n', encoding="utf-8")
    options = ("--parameters", "known.toml", "--turns", "900", "--out", "sets/gap.toml", "--figure", "f.png")
    done = gapsense("gap-law", TABLE, *options)
    assert (done.exit_code, done.stderr) == (0, "")
    said = " ".join(done.stdout.split())
    assert "Only the lowest frequency, 100 Hz, serves" in said and "gapsense identify --inductance" in said
    assert Path("f.png").read_bytes().startswith(b"\x89PNG")
    values, par = read_values([Path("sets/gap.toml")]), parameters_of("solenoid_valve", Path("sets/gap.toml"))
    assert not read_sets([Path("sets/gap.toml")]).assumed
    assert "gap.slope" not in values and values["stop.upper"] == 4e-3 and par.coil_turns == 900.0
    R = par.core_reluctance + np.interp(3.05e-3, par.gap_file_gap, par.gap_file_reluctance)
    inductance = 900.0**2 / R
    assert inductance == pytest.approx(78.56e-3, rel=0.01)


def test_command_refuses_in_words_and_writes_nothing(gapsense, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = gapsense("gap-law", TABLE, "--turns", "900", "--column", "inductance=L_1kHz_mH")
    assert done.exit_code == 2 and "eddy currents keep the flux out of the iron" in done.stderr
    assert not list(tmp_path.iterdir())
