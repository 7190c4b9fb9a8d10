"""The commands around soft landing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.fmi.tables import read_table

ROOT = Path(__file__).resolve().parents[2]


def parameters(text: str) -> Path:
    file = Path("actuator.toml").resolve()
    file.write_text(f'description = "d"\nsource = "s"\n[values]\n{text}\n', encoding="utf-8")
    return file


def refused(done) -> list[str]:
    assert done.exit_code == 2 and not done.stdout, done.output
    return done.stderr.splitlines()


TIMES = ("--making-duration", "5e-3", "--breaking-start", "12e-3")


@pytest.fixture(scope="module")
def usual(tmp_path_factory, following):
    """The table of the actuator as it comes, what the command said, and whether it told how far it was."""
    file = tmp_path_factory.mktemp("usual") / "new" / "drive.csv"
    with following() as assert_rising:
        done = CliRunner().invoke(app, ["soft-landing", "--out", str(file), *TIMES])
    return file, done, assert_rising


@pytest.mark.slow
def test_voltage_table_is_written_and_its_use_told(usual):
    file, done, assert_rising = usual
    assert (done.exit_code, done.stderr) == (0, "")
    times, voltages = read_table(file, ("time [s]", "voltage [V]"))
    assert file.read_text("utf-8").startswith("time [s],voltage [V]\n")
    assert (times[0], times[-1], voltages[0], voltages[-1]) == (0.0, 0.04, 0.0, 0.0)
    assert 20.0 in voltages
    assert re.search(r"^  moving +1 +6 ", done.stdout, re.MULTILINE)
    for words in ("soft_landing.repeat_from = 0.02", f"{len(times)} rows", "nm"):
        assert words in done.stdout
    assert_rising()


def test_heads_of_the_table_are_those_of_a_record(gapsense, usual):
    found = [line for line in refused(gapsense("identify", usual[0])) if "row 1" in line]
    assert len(found) == 1 and "column `current` is missing; there are `time`, `voltage`." in found[0]


@pytest.mark.slow
def test_parameters_of_another_actuator_are_taken(gapsense, usual, monkeypatch, tmp_path):
    file = parameters('"mover.mass" = 2e-3\nhysteresis = false\n"gap.law" = "table"\n"gap.file" = "gap.csv"')
    gaps = "\n".join(f"{k}e-4,{k * (3.2e6 - 5e4 * k)}" for k in range(25))
    (tmp_path / "gap.csv").write_text(f"gap,reluctance\n{gaps}\n", encoding="utf-8")
    monkeypatch.chdir(ROOT)
    done = gapsense("soft-landing", "--out", tmp_path / "a.csv", "--parameters", file, *TIMES)
    assert (done.exit_code, done.stderr) == (0, "")
    assert (tmp_path / "a.csv").read_text() != usual[0].read_text()


def test_wrong_parameters_are_told_at_once(gapsense, monkeypatch):
    file = parameters('"mover.mas" = 2e-3\n"coil.turns" = -5.0\n"gap.law" = "round"\ndamping = "much"')
    monkeypatch.chdir(ROOT)
    lines = refused(gapsense("soft-landing", "--parameters", file))
    assert len(lines) == 4
    expected = (
        "Did you mean `mover.mass`?",
        "is -5.0; expected at least",
        "one of fringing, table",
        "is `much`; expected a number",
    )
    assert all(any(words in line for line in lines) for words in expected)
    assert not (ROOT / "drive.csv").exists()


def test_unstable_core_is_refused_with_the_reason(gapsense, monkeypatch):
    file = parameters('"core.coupling" = 0.01')
    monkeypatch.chdir(ROOT)
    assert "unstable" in refused(gapsense("soft-landing", "--parameters", file))[0]


def test_impossible_motion_is_refused_and_nothing_written(gapsense):
    lines = refused(gapsense("soft-landing", "--out", "drive.csv", "--making-duration", 1.2e-3))
    assert len(lines) == 1 and "would have to push" in lines[0]
    assert not Path("drive.csv").exists()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("reference-cycle", "-1.223"),
        pytest.param("observability-rts", "never observable: t = 5 ms, 15 ms", marks=pytest.mark.slow),
    ],
)
def test_study_prints_its_numbers_and_draws_its_figure(gapsense, rising, command, words):
    done = gapsense("study", command, "--out", "new/figure.png")
    assert (done.exit_code, done.stderr) == (0, "")
    assert words in done.stdout and "new/figure.png written" in done.stdout
    rising()
    assert Path("new/figure.png").stat().st_size > 20_000
    assert "x.txt" in refused(gapsense("study", command, "--out", "x.txt"))[0]
