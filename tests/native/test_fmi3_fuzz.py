"""Thousands of random calls of native FMUs of FMI 3.0 end no process, and are refused with one message each."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from native3 import FOLDERS
from test_robust import gcc, sanitized  # noqa: F401
from unpacked_native import unpack

from gapsense.fmi.components import load_component

HERE = Path(__file__).parent
FEW, MANY = 1000, 10_000
OFTEN = ("drive_voltage",)
WITH_ARRAYS = ("drive_voltage", "ertss")


def fuzzed(folder: Path, natives: Path, calls: int, **environment: str) -> None:
    command = [sys.executable, str(HERE / "fuzz3.py"), str(natives), folder.name, str(calls), "1"]
    path = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path, **environment}
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert calls / 10 < int(done.stdout) < calls


@pytest.mark.parametrize("folder", [f for f in FOLDERS if f.name in OFTEN], ids=lambda folder: folder.name)
def test_random_calls_are_answered(folder: Path, natives: Path) -> None:
    fuzzed(folder, natives, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_ten_thousand_random_calls_are_answered(folder: Path, natives: Path) -> None:
    fuzzed(folder, natives, MANY)


@pytest.mark.slow
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("folder", [f for f in FOLDERS if f.name in WITH_ARRAYS], ids=lambda folder: folder.name)
def test_sanitizers_find_nothing_in_random_calls(folder: Path, natives: Path, tmp_path: Path) -> None:
    name = f"{load_component(folder).name}.fmu"
    unpacked = unpack(natives / "fmi3" / name, tmp_path / "unpacked")
    [library] = sanitized(unpacked)
    (tmp_path / "fmi3").mkdir()
    shutil.make_archive(str(tmp_path / "fmi3" / name), "zip", unpacked.folder)
    (tmp_path / "fmi3" / f"{name}.zip").rename(tmp_path / "fmi3" / name)
    fuzzed(folder, tmp_path, MANY, LD_PRELOAD=library, ASAN_OPTIONS="detect_leaks=0")
