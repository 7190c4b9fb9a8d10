"""Temporary folders and half-written files of dead processes are removed, those of the living are not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gapsense._os import files, locks
from gapsense._os.files import write_atomically

SRC = Path(__file__).resolve().parents[2] / "src"
OTHER = """
import sys
from pathlib import Path
from gapsense._os import files, locks
{code}
print("ready", flush=True)
sys.stdin.readline()
"""


@pytest.fixture
def other(tmp_path):
    """Another process that has run some code and waits; `folder` is defined in it."""
    processes = []

    def start(code: str) -> subprocess.Popen[str]:
        code = OTHER.format(code=f"folder = Path({str(tmp_path)!r})\n{code}")
        pipes = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
        environment = {**os.environ, "PYTHONPATH": str(SRC)}
        processes.append(subprocess.Popen([sys.executable, "-c", code], text=True, env=environment, **pipes))
        assert processes[-1].stdout.readline() == "ready\n"
        return processes[-1]

    yield start
    for process in processes:
        with process:
            process.kill()


def test_folders_of_the_living_stay_and_those_of_the_dead_go(other, tmp_path):
    process = other("(locks.temporary_folder(folder) / 'x').mkdir()")
    (theirs,) = tmp_path.iterdir()
    mine = locks.temporary_folder(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([theirs, mine])
    process.kill()
    process.wait()
    another = locks.temporary_folder(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([mine, another])


def test_folders_of_others_stay(tmp_path):
    for name in ("gapsense-notes", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x").touch()
    (tmp_path / "gapsense-empty").mkdir()  # as a process leaves it that is killed before it has locked anything
    locks.temporary_folder(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} >= {"gapsense-notes", "other"}
    assert not (tmp_path / "gapsense-empty").exists()


def test_handles_of_removed_folders_are_closed(tmp_path):
    for _ in range(20):
        locks.shutil.rmtree(locks.temporary_folder(tmp_path))
    assert sum(folder.parent == tmp_path for folder in locks._folders) == 1


HALF = """
def write(file):
    file.write("half")
    file.flush()
    print("ready", flush=True)
    sys.stdin.readline()
files.write_atomically(folder / "x.csv", write)
"""


def test_what_a_killed_writer_leaves_is_removed_by_the_next(other, tmp_path):
    process = other(HALF)
    (part,) = tmp_path.iterdir()
    files.clean.cache_clear()
    write_atomically(tmp_path / "y.csv", lambda file: file.write("y"))
    assert part.exists()  # its writer lives
    process.kill()
    process.wait()
    files.clean.cache_clear()
    write_atomically(tmp_path / "y.csv", lambda file: file.write("y"))
    assert [p.name for p in tmp_path.iterdir()] == ["y.csv"]


def test_lock_ends_with_its_holder(other, tmp_path):
    (tmp_path / "x").touch()
    process = other("held = (folder / 'x').open('ab')\nassert locks.lock(held)")
    with (tmp_path / "x").open("ab") as file:
        assert not locks.lock(file)
        process.kill()
        process.wait()
        assert locks.lock(file)
