"""Scenarios are tests of pytest: collected, chosen, run side by side, told in the words of `gapsense test`."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]
SRC = Path(__file__).parents[2] / "src"
INSTALLED = any(point.value == "gapsense.pytest_plugin" for point in entry_points(group="pytest11"))
PLUGIN = () if INSTALLED else ("-p", "gapsense.pytest_plugin")
VALVE = """
title = "Valve, 2 ms"
[experiment]
stop = 2e-3
base_step = 25e-6
[components.drive]
fmu = "DriveVoltage"
[components.valve]
fmu = "SolenoidValve"
[connect]
"valve.voltage" = "drive.voltage_mean"
[inputs]
"drive.enable" = 1.0
"drive.reference" = 0.0
[metrics.current]
kind = "max"
signal = "valve.current"
bounds = [0.0, 1.0]
[variants.tight]
metrics.current.bounds = [0.0, 1e-3]
[variants.untested]
components.valve.set.damping = 0.2
"""
OTHERS = {
    "game": 'title = "Siege"\n[experiment]\nname = "x"\n[components.army]\nunits = 3\n',
    "broken": "[experiment\nwave = 1\n",
    "lists": "experiment = [1]\ncomponents = 3\n",
    "empty": "",
    "binary": "\0\1",
}


@pytest.fixture
def project(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, fmus: Path) -> pytest.Pytester:
    """A project with a scenario, its baseline, and files of the same name that mean something else."""
    monkeypatch.setenv("PYTHONPATH", str(SRC))
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)
    for folder, text in {"valve": VALVE, **OTHERS}.items():
        file = pytester.path / "scenarios" / folder / "scenario.toml"
        file.parent.mkdir(parents=True)
        file.write_text(text, encoding="utf-8")
    (pytester.mkdir("build") / "fmus").symlink_to(fmus)
    return pytester


def pytest_of(project: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return project.runpytest_subprocess(*PLUGIN, "-p", "no:cacheprovider", *arguments)


def test_scenarios_and_tested_variants_run_and_nothing_else_and_failures_are_told_in_the_words_of_the_command(project):
    done = pytest_of(project, "scenarios", "-v", "-p", "no:randomly")
    run = [line.split()[:2] for line in done.outlines if "::" in line and "%]" in line]
    assert run == [
        ["scenarios/valve/scenario.toml::valve", "PASSED"],
        ["scenarios/valve/scenario.toml::valve[tight]", "FAILED"],
    ]
    done.assert_outcomes(passed=1, failed=1)
    done.stdout.fnmatch_lines(["*scenario valve?tight?*", "metric current: current = * A*: outside its bounds."])
    assert "Traceback" not in done.stdout.str() and "pytest_plugin.py" not in done.stdout.str()


def test_modules_in_the_working_folder_are_not_imported(project):
    for name in ("csv", "queue", "json", "numpy", "signal"):
        (project.path / f"{name}.py").write_text('open("PWNED", "w"); raise ImportError("shadowed")\n')
    words = (
        Path(sys.executable).with_name("pytest"),
        *PLUGIN,
        "-p",
        "no:cacheprovider",
        "scenarios",
        "-k",
        "not tight",
    )
    done = subprocess.run(words, cwd=project.path, capture_output=True, text=True)  # `project.run` would put it first
    assert "1 passed, 1 deselected" in done.stdout, done.stdout + done.stderr
    assert not (project.path / "PWNED").exists()


@pytest.mark.slow
def test_one_is_chosen_by_its_name(project):
    pytest_of(project, "scenarios", "-k", "valve and not tight").assert_outcomes(passed=1, deselected=1)
    pytest_of(project, "scenarios/valve/scenario.toml::valve[tight]").assert_outcomes(failed=1)


@pytest.mark.slow
def test_they_run_side_by_side(project):
    pytest_of(project, "scenarios", "-n", "2").assert_outcomes(passed=1, failed=1)


@pytest.mark.slow
def test_a_baseline_that_differs_is_three_lines_and_a_picture(project):
    folder = project.path / "scenarios" / "valve"
    made = project.run(sys.executable, "-m", "gapsense.cli", "baseline", str(folder), "--write")
    assert made.ret == 0
    file = folder / "scenario.toml"
    file.write_text(VALVE.replace('fmu = "SolenoidValve"', 'fmu = "SolenoidValve"\nset = { damping = 0.1 }'))
    done = pytest_of(project, "scenarios", "-k", "not tight", "--gapsense-figures", "pictures")
    done.assert_outcomes(failed=1, deselected=1)
    done.stdout.fnmatch_lines(
        ["baseline: valve.* rows differ from the baseline by more than *", "  first t = *; worst t = *", "  worst by *"]
    )
    assert (project.path / "pictures" / "scenarios_valve.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_scenario_that_cannot_be_read_fails_and_the_others_go_on(project):
    file = project.path / "scenarios" / "wrong" / "scenario.toml"
    file.parent.mkdir()
    file.write_text(VALVE.replace("stop = 2e-3", "stop = 2e-3\nstop = 3e-3"))
    done = pytest_of(project, "scenarios", "-k", "not tight")
    done.assert_outcomes(passed=1, failed=1, deselected=1)
    done.stdout.fnmatch_lines(["run: *scenario.toml: not valid TOML*"])


@pytest.mark.slow
def test_it_takes_the_fmus_it_is_told(project, tmp_path):
    done = pytest_of(project, "scenarios", "-k", "not tight", "--gapsense-fmus", str(tmp_path))
    done.assert_outcomes(failed=1, deselected=1)
    done.stdout.fnmatch_lines(["run: *there is no FMU*"])


@pytest.mark.slow
def test_tests_of_others_are_not_disturbed(project):
    project.makepyfile("def test_one(): pass")
    pytest_of(project, "-k", "test_one").assert_outcomes(passed=1, deselected=2)
