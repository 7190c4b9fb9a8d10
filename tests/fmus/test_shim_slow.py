"""The Linux binary under sanitizers, and many exits."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hosting import in_host, raw
from parts import Part

from gapsense._os.native import NativeError
from gapsense.fmi.shim.build import SHIM

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="the shim is for Linux")]

EXITS = 60  # of a process that would crash one time in twenty, 95 % of these tests fail
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


@pytest.fixture(scope="module")
def sanitized(gcc: str, semera: Path, stock: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Extracted FMUs whose binary was compiled with sanitizers."""
    folder = tmp_path_factory.mktemp("sanitized")
    try:
        library = SHIM.compile_with([gcc, *SANITIZERS], folder / "shim.so")
    except NativeError:
        pytest.skip("libasan or libubsan, the sanitizers of gcc, is not installed")
    fmus = {}
    for extracted in (semera, stock / "Lag", stock / "Raiser", stock / "Talker"):
        fmus[extracted.name] = Path(shutil.copytree(extracted, folder / extracted.name))
        shutil.copy(library, folder / extracted.name / "binaries" / "linux64" / f"{extracted.name}.so")
    return fmus


@pytest.fixture(scope="module")
def watched(gcc: str) -> dict[str, str]:
    """Environment of a host that was not compiled with them.  Python itself keeps memory to the end."""
    runtime = subprocess.run([gcc, "-print-file-name=libasan.so"], capture_output=True, text=True, check=True).stdout
    return {"LD_PRELOAD": runtime.strip(), "ASAN_OPTIONS": "detect_leaks=0"}


CALLS = [
    "instances",
    "name_in_latin_1",
    "states",
    "handles",
    "refusal",
    "missing",
    "references",
    "categories",
    "many",
    "lending.asked",
]


@pytest.mark.parametrize("function", CALLS)
def test_calls_under_sanitizers(sanitized: dict[str, Path], watched: dict[str, str], function: str) -> None:
    raw(function, sanitized["Talker" if function == "categories" else "Semera"], **watched)


@pytest.mark.parametrize("seed", range(5))
def test_any_calls_under_sanitizers(sanitized: dict[str, Path], watched: dict[str, str], seed: int) -> None:
    assert set(raw("fuzz", sanitized["Semera"], 10_000, seed, **watched)) == {"0", "3"}


def test_calls_of_two_alike_under_sanitizers(sanitized: dict[str, Path], watched: dict[str, str]) -> None:
    ranges, step = [[-30.0, 30.0], [-0.4, 0.4]], 50e-6
    assert raw("twins", sanitized["Semera"], ranges, 12, step, 20_000, 2, **watched)["DoStep 0"] > 4000


def test_any_calls(part: Part, tmp_path: Path) -> None:
    with zipfile.ZipFile(part.path) as archive:
        archive.extractall(tmp_path)
    assert set(raw("fuzz", tmp_path, 10_000, 1)) == {"0", "3"}


def test_threads_and_forks_under_sanitizers(sanitized: dict[str, Path], watched: dict[str, str], c_host: Path) -> None:
    run = in_host(c_host, sanitized["Lag"], sanitized["Talker"], options="-f -n 60 -t 4 -c 3", **watched)
    assert run.returncode == 0, run.stderr
    run = in_host(c_host, sanitized["Raiser"], options="-n 60 -t 4 -c 3", **watched)
    assert run.returncode == 13, run.stderr


@pytest.mark.parametrize(("name", "code"), [("Lag", 0), ("Raiser", 13)])
def test_many_exits(c_host: Path, stock: Path, name: str, code: int) -> None:
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(lambda k: in_host(c_host, stock / name, options=f"-n {10 + 3 * k} -t 2"), range(EXITS)))
    assert [run.returncode for run in runs] == [code] * EXITS
