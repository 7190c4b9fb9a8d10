"""Stock FMUs, studies of a short scenario, and code in processes that may be killed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SRC = ROOT / "src"
sys.path.insert(0, str(Path(__file__).parent))  # the helpers of this folder can be imported by its tests
from studies_of_ramps import NOISE, STUDY  # noqa: E402


@pytest.fixture(scope="session")
def fmus(shared: Callable[..., Path]) -> Path:
    """Folder with the FMUs Source, Lag, Gain, Noise, Faulty and Types."""

    def build(folder: Path) -> None:
        folder.mkdir()
        command = [sys.executable, str(ROOT / "tests" / "cosim" / "stock_fmus.py"), str(folder)]
        subprocess.run(command, check=True, capture_output=True, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})

    return shared("stock", build)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writer of a study file, with its scenario in the folder `demo` beside it."""

    def write(study: str = STUDY, scenario: str = NOISE, name: str = "ramps") -> Path:
        (tmp_path / "demo").mkdir(exist_ok=True)
        (tmp_path / "demo" / "scenario.toml").write_text(scenario, encoding="utf-8")
        path = tmp_path / f"{name}.toml"
        path.write_text(study, encoding="utf-8")
        return path

    return write


@pytest.fixture
def start(fmus: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts Python code, or a module, in a process that goes on beside the test; `fmus` is defined in the code."""
    with ExitStack() as stack:

        def start(code: str, *arguments: object, **options: object) -> subprocess.Popen[str]:
            environment, pipe = {**os.environ, "PYTHONPATH": str(SRC)}, subprocess.PIPE
            words = (
                ["-c", f"from pathlib import Path\nfmus = Path({str(fmus)!r})\n{code}"]
                if "\n" in code
                else ["-m", code]
            )
            command = [sys.executable, *words, *map(str, arguments)]
            settings = {"stdin": pipe, "stdout": pipe, "stderr": pipe, "text": True, "env": environment, **options}
            process = subprocess.Popen(command, **settings)
            stack.enter_context(process)  # which waits for it, after its end
            stack.callback(process.kill)
            return process

        yield start
