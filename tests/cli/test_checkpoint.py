"""`gapsense run --checkpoint` and `--resume`."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from time import sleep

import numpy as np
import pytest

from gapsense.cosim import Checkpoint, read_result, run

FILE = Path("results", "short.checkpoint")


@pytest.fixture
def saved(write, fmus):
    """A scenario, and the checkpoint at half of its run."""
    folder = write()
    run(folder, fmus=fmus, checkpoint=Checkpoint(FILE, 1.2e-3))
    assert FILE.is_file()
    return folder


def test_resumed_run_gives_the_same_result_and_needs_its_checkpoint_no_more(gapsense, saved, fmus):
    whole = run(saved, fmus=fmus)
    done = gapsense("run", saved, "--fmus", fmus, "--resume")
    assert done.exit_code == 0 and not FILE.exists()
    resumed = read_result(Path("results", "short.csv"))
    assert {n: s.tobytes() for n, s in whole.signals.items()} == {n: s.tobytes() for n, s in resumed.signals.items()}
    assert whole.metrics == resumed.metrics


def test_complete_run_leaves_no_checkpoint(gapsense, write, fmus):
    assert gapsense("run", write(), "--fmus", fmus, "--checkpoint", "5e-4").exit_code == 0
    assert sorted(file.name for file in Path("results").iterdir()) == ["short.csv", "short.json"]


def test_checkpoint_of_another_run_is_refused_and_kept(gapsense, write, saved, fmus):
    write(("sensor = 1\n", "sensor = 2\n"))
    done = gapsense("run", saved, "--fmus", fmus, "--resume")
    assert done.exit_code == 2 and FILE.is_file()
    for what in ("a scenario", "seeds"):
        assert f"{FILE}: it was saved with {what} other than now. Start without `--resume`." in done.output


@pytest.mark.parametrize(
    ("content", "sentence"),
    [(None, "there is no checkpoint. Run with `--checkpoint` first."), (b"PK\3\4torn", "not a checkpoint")],
)
def test_missing_and_broken_checkpoints_are_told(gapsense, write, fmus, content, sentence):
    FILE.parent.mkdir()
    if content is not None:
        FILE.write_bytes(content)
    done = gapsense("run", write(), "--fmus", fmus, "--resume")
    assert done.exit_code == 2 and f"{FILE}: {sentence}" in done.output


@pytest.mark.parametrize("time", ["1e-6", "-1", "nan"])
def test_senseless_times_are_refused(gapsense, write, fmus, time):
    done = gapsense("run", write(), "--fmus", fmus, "--checkpoint", time)
    assert done.exit_code == 2 and f"{float(time):.9g} s found, at least `base_step` = 2.5e-05 s" in done.output


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_interrupted_run_can_be_gone_on_with(process, write, fmus):
    folder = write(("stop = 2e-3", "stop = 20.0"))
    started = process("from gapsense.cli import app; app()", "run", folder, "--fmus", fmus, "--checkpoint", "1e-3")
    while not FILE.is_file():
        assert started.poll() is None
        sleep(0.01)
    started.send_signal(signal.SIGINT)
    _, err = started.communicate(timeout=30)
    assert started.returncode == 130 and err.rstrip().endswith("use `--resume` to continue from the checkpoint.")
    side = json.loads(Path("results", "short.json").read_text("utf-8"))
    assert side["interrupted"] and saved_rows(FILE) == side["rows"]


def saved_rows(file):
    with np.load(file) as arrays:
        return arrays["data"].shape[0]
