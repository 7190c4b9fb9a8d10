"""Fixtures that several test folders use."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the FMU of every component, built by another process, as FMUs should be before they are loaded."""
    out = tmp_path_factory.getbasetemp() / "fmus"
    done = subprocess.run(
        [sys.executable, str(ROOT / "build_fmus.py"), "--out", str(out)],
        capture_output=True,
        text=True,
        env={**__import__("os").environ, "PYTHONPATH": str(ROOT / "src")},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out
