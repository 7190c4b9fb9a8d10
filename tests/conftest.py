"""Fixtures that several test folders use."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gapsense.fmi.native.platforms import chosen, compilers
from gapsense.native import NativeError

ROOT = Path(__file__).resolve().parents[1]


def built(out: Path, *options: str) -> Path:
    """Folder with the FMU of every component, built by another process, as FMUs should be before they are loaded."""
    done = subprocess.run(
        [sys.executable, str(ROOT / "build_fmus.py"), "--out", str(out), *options],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python FMUs."""
    return built(tmp_path_factory.getbasetemp() / "fmus")


@pytest.fixture(scope="session")
def natives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native FMUs, for this machine only."""
    try:
        compilers(*chosen(["here"]))
    except NativeError as error:
        pytest.skip(f"no C compiler for native FMUs: {error}")
    return built(tmp_path_factory.getbasetemp() / "natives", "--platforms", "here")
