"""Thousands of random calls of native FMUs of FMI 3.0 end no process, and are refused with one message each."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from native3 import FOLDERS

FEW, MANY = 1000, 10_000
OFTEN = ("drive_voltage",)


def fuzzed(folder: Path, natives: Path, calls: int) -> None:
    command = [sys.executable, str(Path(__file__).with_name("fuzz3.py")), str(natives), folder.name, str(calls), "1"]
    path = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr[-2000:]
    assert calls / 10 < int(done.stdout) < calls


@pytest.mark.parametrize("folder", [f for f in FOLDERS if f.name in OFTEN], ids=lambda folder: folder.name)
def test_random_calls_are_answered(folder: Path, natives: Path) -> None:
    fuzzed(folder, natives, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_ten_thousand_random_calls_are_answered(folder: Path, natives: Path) -> None:
    fuzzed(folder, natives, MANY)
