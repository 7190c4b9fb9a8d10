"""A wrong value of a parameter is refused by every command that takes values, in the same words."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BOTH_STOPS = '"stop.lower" = 2e-3\n"stop.upper" = 1e-3\n'
STOPS = "`stop.lower` is 0.002; expected less than `stop.upper` = 0.001."
COMMANDS = {
    "build": ("build", "solenoid_valve", "ekf", "--out", "out"),
    "identify": ("identify", ROOT / "README.md", "--out", "out.toml"),
    "soft-landing": ("soft-landing", "--out", "out"),
    "reduced-fit": ("study", "reduced-fit"),
    "estimate": ("estimate", "record.csv", "--estimator", "ekf", "--figure", "out.png"),
}
RECORD = "time [s],voltage [V],current [A],mode [1]\n" + "".join(f"{k * 2e-5:g},0,0,3\n" for k in range(60))


def refused(gapsense, monkeypatch, tmp_path, command: str, values: str) -> list[str]:
    monkeypatch.chdir(tmp_path)
    Path("set.toml").write_text(f"[values]\n{values}", encoding="utf-8")
    Path("record.csv").write_text(RECORD, encoding="utf-8")
    words = COMMANDS[command]
    if words[0] in ("build", "estimate"):  # which look for a checkout
        words = [str(tmp_path / w) if w in ("out", "out.png", "record.csv") else w for w in words]
        monkeypatch.chdir(ROOT)
    done = gapsense(*words, "--parameters", tmp_path / "set.toml")
    assert done.exit_code == 2, done.output
    assert not any((tmp_path / made).exists() for made in ("out", "out.toml", "out.png")) and not done.stdout
    return done.stderr.splitlines()


@pytest.mark.parametrize("command", COMMANDS)
def test_stops_that_are_exchanged_are_refused(gapsense, monkeypatch, tmp_path, command):
    lines = refused(gapsense, monkeypatch, tmp_path, command, BOTH_STOPS)
    assert lines and all(line.endswith(STOPS) for line in lines), lines


@pytest.mark.parametrize("command", COMMANDS)
def test_true_is_no_resistance(gapsense, monkeypatch, tmp_path, command):
    lines = refused(gapsense, monkeypatch, tmp_path, command, '"coil.resistance" = true\n')
    assert lines and all(line.endswith("`coil.resistance` is true; expected a number.") for line in lines), lines


def test_limits_hold_where_start_values_are_built_in(gapsense, monkeypatch, tmp_path):
    monkeypatch.setitem(COMMANDS, "build", ("build", "reluctance_actuator", "--out", "out"))
    for command in ("build", "soft-landing"):
        (line,) = refused(gapsense, monkeypatch, tmp_path, command, '"core.coupling" = 0.01\n')
        assert "`core.coupling`" in line and "unstable" in line


@pytest.mark.parametrize("command", COMMANDS)
def test_unknown_names_are_refused_with_the_nearest_one(gapsense, monkeypatch, tmp_path, command):
    lines = refused(gapsense, monkeypatch, tmp_path, command, '"stop.uper" = 1.0\n"coil.resistance" = 50.0\n')
    assert lines == ["set.toml: there is no parameter `stop.uper`. Did you mean `stop.upper`?"]
