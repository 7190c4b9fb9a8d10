"""Small FMUs, and scenarios and packages made of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).parent
COSIM = HERE.parent / "cosim"
sys.path.insert(0, str(HERE))  # the helpers of this folder can be imported by its tests
sys.path.insert(0, str(COSIM))


@pytest.fixture(scope="session")
def stock(shared: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """Folder with the FMUs Source, Lag, Gain and others of Python."""

    def make(folder: Path) -> None:
        folder.mkdir()
        environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, str(COSIM / "stock_fmus.py"), str(folder)]
        subprocess.run(command, check=True, env=environment, capture_output=True)

    return shared("stock", make)


@pytest.fixture(scope="session")
def types(shared: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """Folder with the FMUs Types2 and Types3, written in C."""
    gcc = shutil.which("gcc")
    if gcc is None or not sys.platform.startswith("linux"):
        pytest.skip("gcc on Linux compiles the FMUs")
    import foreign_fmus

    def make(folder: Path) -> None:
        folder.mkdir()
        for version in (2, 3):
            foreign_fmus.build(gcc, version, folder)

    return shared("types", make)
