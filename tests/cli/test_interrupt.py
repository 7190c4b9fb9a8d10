"""Ctrl-C keeps what was computed."""

from __future__ import annotations

import json
import shutil
import signal
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
VALVE = Path(__file__).resolve().parents[2] / "scenarios" / "semera_valve"
LOUD = """
import contextlib, sys
from gapsense.cli import app, common

@contextlib.contextmanager
def bar(title):
    said = []
    def progress(done, total):
        if done and not said:
            said.append(print(title))
    yield progress

common.bar = bar  # says when the run is under way
app()
"""


@pytest.fixture
def long(tmp_path):
    """A copy of the scenario of the valve that runs for minutes."""
    folder = Path(shutil.copytree(VALVE, tmp_path / "long", ignore=shutil.ignore_patterns("baseline*")))
    text = (folder / "scenario.toml").read_text("utf-8")
    assert text.count("stop = 100e-3") == 1
    (folder / "scenario.toml").write_text(text.replace("stop = 100e-3", "stop = 20.0"), encoding="utf-8")
    return folder


def interrupted(process):
    """Exit code and both outputs of a process that gets a Ctrl-C as soon as it has said that it is under way."""
    assert process.stdout.readline().strip() in ("running", "sweeping")
    process.send_signal(signal.SIGINT)
    outputs = process.communicate(timeout=60)
    return process.returncode, *outputs


def test_interrupted_run_leaves_a_partial_result_and_says_so(process, long, fmus, tmp_path):
    code, out, err = interrupted(process(LOUD, "run", long, "--fmus", fmus, "--out", tmp_path / "out"))
    assert code == 130, err
    assert "Traceback" not in err and err.startswith("interrupted at t = ") and "long.csv" in err
    assert "real-time factor" in out
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["long.csv", "long.json"]
    rows = len((tmp_path / "out" / "long.csv").read_text("utf-8").splitlines()) - 1
    side = json.loads((tmp_path / "out" / "long.json").read_text("utf-8"))
    assert side["interrupted"] and side["rows"] == rows and 1 < rows < 800_000
    assert not side["metrics"]


def test_interrupted_figure_writes_nothing(process, long, fmus, tmp_path):
    code, _, err = interrupted(process(LOUD, "figure", long, "--fmus", fmus, "--out", tmp_path / "out" / "x.png"))
    assert code == 130 and "nothing was written" in err and "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_interrupted_sweep_goes_on_later(process, fmus, tmp_path):
    command = ("sweep", VALVE, "--seeds", 50, "--workers", 1, "--fmus", fmus, "--out", tmp_path / "out")
    code, out, err = interrupted(process(LOUD, *command))
    assert code == 130 and "the same command goes on from here" in err and "Traceback" not in err
    lines = (tmp_path / "out" / "semera_valve_sweep.jsonl").read_text("utf-8").splitlines()
    done = sum("metrics" in json.loads(line) for line in lines)
    assert 1 <= done < 50
    assert f"{done} runs, {done} of them computed now" in out
    assert len(list((tmp_path / "out").iterdir())) == 1
