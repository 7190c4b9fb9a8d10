"""`gapsense run` given in the usual way, which needs no parser of command lines."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gapsense.cli.straight import parse_run


@pytest.mark.parametrize(
    ("words", "given"),
    [
        (["my_valve"], {"scenario": Path("my_valve")}),
        (["my_valve", "--native"], {"scenario": Path("my_valve"), "--native": True}),
        (
            ["--variant", "cold", "a", "--set", "v.x=-1", "--set", "v.y=2", "--out", "b.csv"],
            {"--variant": "cold", "scenario": Path("a"), "--set": ["v.x=-1", "v.y=2"], "--out": Path("b.csv")},
        ),
    ],
)
def test_usual_options_are_understood(words, given):
    assert parse_run(words) == given


@pytest.mark.parametrize(
    "words",
    [
        *([], [""], ["a", "b"], ["-h"], ["a", "--out"], ["a", "--out", "--native"], ["a", "--out=b"], ["a", "--"]),
        *(["a", "--native", "--native"], ["a", "--variant", "x", "--variant", "y"], ["a", "--checkpoint", "1e-3"]),
        *(["a", "--check"], ["--set", "v.x=1"], ["a", "--nativ"], ["a", "--set", ""]),
    ],
)
def test_other_words_are_left_to_the_command_line(words):
    assert parse_run(words) is None


def test_shell_that_asks_for_completions_gets_them_from_the_command_line(monkeypatch):
    monkeypatch.setenv("_GAPSENSE_COMPLETE", "complete_bash")
    assert parse_run(["a"]) is None


def test_usual_run_loads_neither_typer_nor_fmpy(gapsense, tmp_path):
    assert gapsense("run", "semera_valve", "--out", tmp_path / "before.csv").exit_code == 0  # which may read the FMUs
    code = (
        "import atexit, sys, gapsense.__main__ as m\n"
        "atexit.register(lambda: print(sorted({'typer', 'fmpy', 'lxml', 'pydantic'} & set(sys.modules))))\n"
        "m.main()"
    )
    command = [sys.executable, "-c", code, "run", "semera_valve", "--out", str(tmp_path / "a.csv")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
    assert (tmp_path / "a.csv").is_file()


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("given", "kept"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")])
def test_numpy_starts_no_threads_unless_they_are_asked_for(given, kept):
    shown = "os.environ['OPENBLAS_NUM_THREADS'], len(os.listdir('/proc/self/task'))"
    code = f"import os, gapsense.__main__, numpy; print({shown})"
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"} | given
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    variable, threads = done.stdout.split()
    assert variable == kept and (given or threads == "1")
