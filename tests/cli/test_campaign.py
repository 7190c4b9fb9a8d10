"""The commands of campaigns: run, show, figure, and what they say when something is wrong."""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from gapsense.cli import app

STUDY = """
title = "Amplitudes"
scenario = "SCENARIO"
[grid]
"drive.square.amplitude" = [24.0, 30.0]
"""


@pytest.fixture
def study(write, tmp_path):
    file = tmp_path / "amplitudes.toml"
    scenario = write(("[metrics.current_error]", "[metrics.largest]"))
    file.write_text(STUDY.replace("SCENARIO", scenario.as_posix()), encoding="utf-8")
    return file


def call(*arguments):
    result = CliRunner().invoke(app, ["campaign", *map(str, arguments)])
    return result.exit_code, result.output


def test_run_show_and_figure(study, fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call(study, "--fmus", fmus, "--check") == (0, f"{study}: no problems.\n")
    code, said = call("--workers", 1, "--engine", "fmu", study, "--fmus", fmus)
    assert code == 0 and said.splitlines()[-1] == "results/amplitudes: 2 of 2 runs, 2 of them done now.", said
    code, said = call("run", study, "--fmus", fmus)
    assert code == 0 and said.splitlines()[-1].endswith("2 of 2 runs, 0 of them done now.")
    code, said = call("show", "results/amplitudes")
    assert code == 0 and "drive.square.amplitude" in said and "current [mA]" in said
    code, said = call("figure", "results/amplitudes")
    assert (code, (tmp_path / "results" / "amplitudes.png").read_bytes()[:4]) == (0, b"\x89PNG"), said


def test_wrong_input_is_told(study, fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("none.toml") == (2, "none.toml: there is no such file. Correct the path.\n")
    study.write_text(study.read_text().replace("24.0", '"high"'))
    code, said = call(study, "--fmus", fmus, "--check")
    assert code == 2 and "amplitudes.toml, grid.drive.square.amplitude:" in said
    assert call("show", tmp_path)[0] == 2
    assert call("figure", tmp_path, "--out", "x.txt")[0] == 2
    assert call("--workers", 0, study)[0] == 2
    assert "show" in call("--help")[1]


def test_missing_package_is_told(study, fmus, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("gapsense.many.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    code, said = call(study, "--fmus", fmus)
    assert (code, said) == (2, "campaigns need pyarrow, which is not installed: `pip install 'gapsense[campaign]'`.\n")


@pytest.mark.parametrize("left", range(8))
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EMFILE])
def test_full_disk_is_told_with_the_file_and_costs_nothing_that_was_done(
    study, fmus, tmp_path, monkeypatch, left, number
):
    calls = []

    def limited(handle):
        calls.append(handle)
        if len(calls) > left:
            raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", limited)
        code, said = call(study, "--fmus", fmus, "--out", tmp_path / "out", "--workers", 1, "--engine", "fmu")
    assert len(calls) > left
    words = {errno.ENOSPC: "Make room on its disk", errno.EMFILE: "Allow more open files (`ulimit -n`)"}[number]
    said = " ".join(said.split())
    assert code == 2 and f"{os.strerror(number)}. {words}, or " in said, said
    assert said.startswith(f"`{tmp_path / 'out'}/") and "Errno" not in said and "None" not in said, said
    code, said = call(study, "--fmus", fmus, "--out", tmp_path / "out", "--workers", 1, "--engine", "fmu")
    assert code == 0 and "2 of 2 runs" in said, said


LIMITED = """
import resource, sys
from gapsense.cli import app
resource.setrlimit(resource.RLIMIT_NOFILE, (int(sys.argv.pop(1)),) * 2)
app()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sets a limit of POSIX")
@pytest.mark.parametrize("most", [8, 12, 15])
@pytest.mark.parametrize("command", ["campaign", "sweep"])
def test_too_many_open_files_are_told_with_what_to_do(study, fmus, tmp_path, most, command):
    given = study if command == "campaign" else "semera_valve"
    words = [str(most), command, str(given), "--fmus", str(fmus), "--out", str(tmp_path / "out"), "--engine", "fmu"]
    done = subprocess.run([sys.executable, "-c", LIMITED, *words], capture_output=True, text=True, check=False)
    said = " ".join(done.stderr.split())
    assert done.returncode == 2 and "Too many open files" in said and "Allow more open files (`ulimit -n`)" in said, (
        said
    )
    assert said.startswith("`") and "Errno" not in said and "Traceback" not in said, said
