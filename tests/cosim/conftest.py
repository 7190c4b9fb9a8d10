"""Stock FMUs, built once per session in a process of their own, and a writer of scenario files."""

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import warm

from gapsense.cosim.run.loop import compiled

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # the helpers of this folder can be imported by its tests
SRC = HERE.parents[1] / "src"


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the FMUs Source, Lag, Gain, Noise, Faulty, Types, Tuned and Switch."""
    folder = tmp_path_factory.mktemp("fmus")
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run(
        [sys.executable, str(HERE / "stock_fmus.py"), str(folder)], check=True, env=environment, capture_output=True
    )
    return folder


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the FMUs Types2, Types3 and Arrays, written in C."""
    gcc = shutil.which("gcc")
    if gcc is None or (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip("gcc on Linux on x86-64 compiles the FMUs")
    import foreign_fmus

    folder = tmp_path_factory.mktemp("foreign")
    for version in (2, 3):
        foreign_fmus.build(gcc, version, folder)
    foreign_fmus.build_arrays(gcc, folder)
    return folder


@pytest.fixture(scope="session", params=[2, 3])
def coupled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the FMUs Node, Mass, Spring and Circuit, written in C, of FMI 2.0 and of FMI 3.0."""
    return built_coupled(tmp_path_factory, request.param)


@pytest.fixture(scope="session")
def coupled_2(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Those of FMI 2.0, whose inputs go in a straight line."""
    return built_coupled(tmp_path_factory, 2)


def built_coupled(tmp_path_factory: pytest.TempPathFactory, fmi: int) -> Path:
    """Folder with FMUs for loops."""
    if shutil.which("gcc") is None or (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip("gcc on Linux on x86-64 compiles the FMUs")
    from coupled import coupled_fmus

    return coupled_fmus.build(tmp_path_factory.mktemp("coupled"), fmi)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writer of a scenario file into a folder of its own; further files by name."""

    def write(text: str, folder: str = "demo", **files: str) -> Path:
        path = tmp_path / folder / "scenario.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        for name, content in files.items():
            (path.parent / f"{name}.toml").write_text(content, encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def loop_binary() -> Path:
    """The library that does base steps; a module may override it to do without."""
    return compiled.BINARY


@pytest.fixture
def python(fmus: Path, loop_binary: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs Python code in a process of its own, for what may crash or kill it; `fmus` is defined in it.

    Where Gapsense is imported already, as in workers: to start a Python takes longer than most of what it is asked for.
    """

    def python(code: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONPATH": str(SRC)}
        head = f"from pathlib import Path\nfmus = Path({str(fmus)!r})\n"
        head += f"from gapsense.cosim.run.loop import compiled\ncompiled.BINARY = Path({str(loop_binary)!r})\n"
        return warm.run(head + code, imports=warm.Worker.IMPORTS, given="", env=environment)

    return python


@pytest.fixture
def start(fmus: Path) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Starts Python code in a process that goes on beside the test; `fmus` is defined in it."""
    with ExitStack() as stack:

        def start(code: str) -> subprocess.Popen[str]:
            environment, pipe = {**os.environ, "PYTHONPATH": str(SRC)}, subprocess.PIPE
            command = [sys.executable, "-c", f"from pathlib import Path\nfmus = Path({str(fmus)!r})\n{code}"]
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=environment)
            stack.callback(process.kill)
            return stack.enter_context(process)

        yield start


CHAIN = """
title = "Ramp through a lag and a gain"

[experiment]
stop = 1.0
base_step = 0.1

[components.source]
fmu = "Source"
set = { slope = 2.0 }

[components.lag]
fmu = "Lag"

[components.gain]
fmu = "Gain"

[[connections]]
from = "source.y"
to = "lag.u"

[[connections]]
from = "lag.y"
to = "gain.u"
"""


@pytest.fixture
def chain() -> str:
    """Text of a scenario: ramp source, lag, gain."""
    return CHAIN
