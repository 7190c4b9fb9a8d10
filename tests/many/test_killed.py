"""Processes of a campaign that are killed or interrupted lose nothing, and two on one folder do nothing twice."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from studies_of_ramps import NOISE, STUDY, rows

from gapsense import campaign, read_campaign

pytestmark = pytest.mark.slow
LONG = NOISE.replace("stop = 10.0", "stop = 300.0")


@pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")
def test_killed_worker_processes_lose_nothing(write, fmus, tmp_path):
    study = write(STUDY.replace("seeds = 2", "seeds = 8"), LONG)
    expected, killed = rows(campaign(study, 1, tmp_path / "alone", fmus)), []

    def kill(done, total):  # what came together is told together
        if len(killed) < 2 and 3 + 12 * len(killed) <= done < total - 6:
            own = [pid for pid in children() if b"gapsense._os.processes" in command(pid)]
            killed.append(max(own, key=seconds))  # it has done runs: one that is killed at its start ends them all
            os.kill(killed[-1], signal.SIGKILL)

    result = campaign(study, 2, tmp_path / "killed", fmus, progress=kill)
    assert len(killed) == 2
    assert (rows(result), result.failed) == (expected, 0)


def children():
    """Processes that this one has started."""
    tasks = Path("/proc/self/task").iterdir()
    return [int(pid) for task in tasks for pid in (task / "children").read_text().split()]


def seconds(pid):
    """Time that a process has worked."""
    return sum(map(int, Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]))


def command(pid):
    return Path(f"/proc/{pid}/cmdline").read_bytes()


CLIENT = """
import sys
from gapsense import campaign, read_campaign
told = lambda done, total: print(done, flush=True)
campaign(sys.argv[1], 2, sys.argv[2], fmus, progress=told)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
def test_killed_client_loses_what_was_under_way_only(write, fmus, start, tmp_path):
    study, out = write(STUDY.replace("seeds = 2", "seeds = 6"), LONG), tmp_path / "out"
    process = start(CLIENT, study, out)
    told = 0
    while told < 12:
        told = int(process.stdout.readline())
    process.send_signal(signal.SIGKILL)
    told = max([told, *map(int, process.stdout.read().split())])
    there = read_campaign(out).rows
    assert 12 <= told <= there < 36
    result = campaign(study, 2, out, fmus)
    assert (result.rows, result.computed) == (36, 36 - there)
    assert result.column("run").tolist() == [*range(36)]
    assert rows(result) == rows(campaign(study, 1, tmp_path / "alone", fmus))


INTERRUPT = """
import os, signal, sys
from gapsense import campaign, read_campaign
stop = lambda done, total: os.kill(os.getpid(), signal.SIGINT) if done > 2 else None
result = campaign(sys.argv[1], 1, sys.argv[2], fmus, progress=stop)
print(result.interrupted, 3 <= result.rows < 36)
"""


def test_ctrl_c_keeps_what_was_done(write, fmus, start, tmp_path):
    study = write(STUDY.replace("seeds = 2", "seeds = 6"), LONG)
    output, error = start(INTERRUPT, study, tmp_path / "out").communicate(timeout=60)
    assert output.split() == ["True", "True"], error
    there = read_campaign(tmp_path / "out").rows
    assert campaign(study, 1, tmp_path / "out", fmus).computed == 36 - there


HELD = """
import sys, time
from dataclasses import replace
from pathlib import Path
from gapsense import campaign, read_campaign
def hold(done, total):
    print(done, flush=True)
    while not Path(sys.argv[3]).exists():
        time.sleep(0.01)
campaign(sys.argv[1], 2, sys.argv[2], fmus, progress=hold)
"""


def test_two_clients_on_one_folder_do_nothing_twice(write, fmus, start, tmp_path):
    study, out, go = write(STUDY, LONG), tmp_path / "out", tmp_path / "go"
    first = start(HELD, study, out, go)
    assert int(first.stdout.readline()) < 12
    second = start(CLIENT, study, out)
    assert "another process is using it" in second.stderr.readline()
    go.touch()
    said = [process.communicate(timeout=60)[0].split() for process in (first, second)]
    assert read_campaign(out).column("run").tolist() == [*range(12)]
    assert said[0][-1] == "12" and said[1] == ["12"], said


OWN = 'title = "x"\nscenario = "demo"\nseeds = 2\nnoise = "own"\n[grid]\n"source.slope" = [1.0, 2.0]\n'
FAULTY = (
    NOISE
    + '[components.coil]\nfmu = "Faulty"\nset = { fault = "FAULT", at = 5.0, only = 2 }\n[inputs]\n"coil.u" = 0.0\n'
)
SEEDED = FAULTY.replace("noise = 10", "noise = 10\ncoil = 0")


def test_failed_runs_are_rows_and_are_tried_again_when_asked_for(write, fmus, tmp_path):
    study, out = write(OWN, SEEDED.replace("FAULT", "kill")), tmp_path / "out"
    for retry, computed in ((False, 4), (False, 0), (True, 1)):
        result = campaign(study, 2, out, fmus, retry=retry)
        assert (result.computed, result.rows, result.failed) == (computed, 4, 1)
        ((index, error),) = result.errors(5)
        assert index == 2
        assert (
            error == "coil, t = 5 s (base step 51): its process was ended by signal 9 (SIGKILL, Killed), in its step."
        )
        assert np.isnan(result.column("end")[2]) and np.isfinite(result.column("end")[[0, 1, 3]]).all()
