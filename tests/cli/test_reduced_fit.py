"""gapsense study reduced-fit: a fit to the paper's cycle or to a measured record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
TIMES = np.linspace(0.0, 10e-3, 500)


KNOWN = """[values]
"coil.resistance" = 48.0
"coil.turns" = 1200.0
"stop.lower" = 0.4e-3
"stop.upper" = 1.4e-3
"gap.slope" = 4.7e10
"gap.fringing" = 300.0
"gap.window" = 9.73e-3
"""


@pytest.fixture
def known(tmp_path):
    """What no record tells of the device."""
    (tmp_path / "known.toml").write_text(KNOWN, encoding="utf-8")
    return "--parameters", str(tmp_path / "known.toml")


@pytest.fixture
def record(tmp_path, monkeypatch):
    """A coil with a resting mover and an almost constant inductance."""
    flux = 0.01 * np.sin(np.pi * TIMES / 10e-3) ** 2
    current = (32.0 + 1.75 / (1.0 - flux / 0.0238)) * flux
    voltage = 48.0 * current + np.gradient(flux, TIMES)
    file = tmp_path / "cycle.csv"
    monkeypatch.chdir(ROOT)
    rows = zip(TIMES, voltage, current, np.full(500, 1.4e-3))
    file.write_text("time,voltage,current,position\n" + "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in rows))
    return file


def test_record_without_the_scales_of_its_device_is_refused_by_name(gapsense, record):
    done = gapsense("study", "reduced-fit", "--record", str(record))
    assert done.exit_code == 2 and not done.stdout and "--assume" not in done.stderr
    assert all(f"`{name}` (" in done.stderr for name in ("coil.turns", "stop.lower", "gap.fringing")), done.stderr


def test_record_is_fitted(gapsense, record, known):
    done = gapsense("study", "reduced-fit", "--record", str(record), *known)
    assert done.exit_code == 0, done.output
    assert "cycle.csv" in done.output and "500" in done.output and "published" not in done.output


def test_wrong_record_is_refused_with_what_is_wrong(gapsense, record, known):
    record.write_text("time,current\n0,1\n")
    done = gapsense("study", "reduced-fit", "--record", str(record), *known)
    assert "column voltage, position is missing" in done.output
    record.write_text("time,voltage,current,position\n0,1,1,1\n1,1,1,1\n1,1,1,1\n")
    done = gapsense("study", "reduced-fit", "--record", str(record), *known)
    assert done.exit_code == 2 and "line 4: `time` does not rise" in done.output


def test_wrong_parameters_are_refused(gapsense, record, tmp_path):
    (tmp_path / "device.toml").write_text('[values]\n"coil.resistence" = 50.0\n')
    done = gapsense("study", "reduced-fit", "--record", str(record), "--parameters", str(tmp_path / "device.toml"))
    assert done.exit_code == 2 and "Did you mean `coil.resistance`" in done.output
