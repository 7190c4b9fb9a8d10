"""`gapsense study profiles`."""

import shutil
from pathlib import Path

import pytest

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "profiles"
ONE = (
    ('first" = [1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3, 3.5e-3, 4e-3]', 'first" = [2e-3]'),
    ('second" = [1e-3, 1.25e-3, 1.5e-3, 1.75e-3, 2e-3]', 'second" = [1e-3]'),
)


def short(folder, *changes):
    """The scenario with one profile, and with pieces replaced."""
    copy = shutil.copytree(SCENARIO, folder / "profiles")
    text = (copy / "scenario.toml").read_text(encoding="utf-8")
    for old, new in (*ONE, *changes):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (copy / "scenario.toml").write_text(text, encoding="utf-8")
    return copy


@pytest.mark.slow
def test_study_runs_the_profiles_prints_numbers_and_draws(gapsense, fmus, tmp_path):
    done = gapsense("study", "profiles", short(tmp_path), "--variant", "early", "--fmus", fmus, "--workers", 1)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert lines[:2] == ["profiles[early]: Making and breaking with braking pulses, [RTS] Section IV-F", "1 profiles"]
    assert sum(line.startswith("ERTSS, ") for line in lines) == 2
    assert "published about 75 %" in done.stdout
    assert sorted(p.name for p in (tmp_path / "results").glob("*.png")) == [
        f"profiles_early_{number}.png" for number in (12, 14, 15)
    ]


def test_what_is_not_recorded_is_told_before_the_runs(gapsense, fmus, tmp_path):
    scenario = short(tmp_path, ('"*.velocity", ', ""))
    done = gapsense("study", "profiles", scenario, "--variant", "threshold_mode", "--fmus", fmus)
    assert done.exit_code == 2
    assert "the study of the profiles needs `ekf.velocity`, not recorded" in done.stderr.replace("\n", " ")
    assert not (tmp_path / "results").exists()
