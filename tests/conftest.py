"""Fixtures that several test folders use."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

sys.path.append(str(Path(__file__).parent / "fmus"))  # with helpers
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: to start threads takes half its time

import pytest
import typer.testing
import warm
from hypothesis import HealthCheck, settings

from gapsense._os import locks, processes
from gapsense._os.native import ZIG, NativeError, zig_version
from gapsense.cli.console import consoles
from gapsense.fmi.native.platforms import choose_platforms, compilers
from gapsense.many import store

ROOT = Path(__file__).resolve().parents[1]
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
STARTED = {  # files whose tests are about processes themselves, and how they start and end
    *("test_strays", "test_apart", "test_unpacked", "test_shadows", "test_interrupt"),
    *("test_workers", "test_processes", "test_cluster", "test_run", "test_killed"),
}
LONG = (  # files that take minutes in the long tests, the longest first, and those of the quick ones after them
    *("test_identification_losses", "test_identification_conditions", "test_everywhere", "test_run_to_run_demands"),
    *("test_blocks", "test_forged_states", "test_site", "test_drawn_records", "test_parity", "test_platforms"),
    *("test_benchmarks", "test_in_browser", "test_export", "test_shipped", "test_boards", "test_installed"),
    *("test_loop_emulated", "test_commissioning_records", "test_cluster", "test_natives", "test_robust"),
    *("test_identification_drive", "test_needed", "test_coil", "test_html_many", "test_low_pass", "test_interrupt"),
    *("test_workers", "test_library", "test_soft_landing", "test_other_valves", "test_monte_carlo", "test_gap_law"),
)
store.SYNCHRONOUS = "OFF"  # no test cuts the power, and six thousand waits for the disk take 20 s
gc.disable()  # until all tests have been found, which takes three times as long with it
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])  # no test is timed
settings.load_profile("busy")
os.environ.setdefault("GAPSENSE_CACHE", str(ROOT / "build" / "cache"))  # of libraries for many runs
if hasattr(typer.testing, "_get_command"):  # else every call of a command makes all of them anew, in 60 ms
    typer.testing._get_command = cache(typer.testing._get_command)


def pytest_configure(config: pytest.Config) -> None:
    """The second worker reads the folders from the last one on: what pytest makes of a file is then made once.

    Quick tests need many libraries and run each for a moment; slow tests compile as users do.
    """
    if config.getoption("markexpr") == "not slow":
        os.environ.setdefault("C_CODE_LEVEL", "-O0")
        if sys.platform == "linux" and shutil.which("cc"):
            os.environ.setdefault("CC", str(Path(__file__).with_name("cc")))
    if getattr(config, "workerinput", {}).get("workerid") == "gw1" and config.args == config.getini("testpaths"):
        folders = {str(file.parent) for file in Path(__file__).parent.glob("*/test_*.py")}
        config.args = sorted(folders, reverse=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, so that both workers end at the same time.

    Before them those that wait a quarter of their time, for processes and limits: `make test` checks types meanwhile.
    """
    last = len(LONG)

    def place(item: pytest.Item) -> tuple[bool, int, Path]:
        name, is_slow = item.path.stem, item.get_closest_marker("slow") is not None
        return is_slow or item.path.parent.name != "cosim", LONG.index(name) if name in LONG else last, item.path

    items.sort(key=place)


def pytest_collection_finish() -> None:
    """Ten thousand tests need not be looked at each time that memory is cleared up, nor that every 700 objects."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)
    gc.enable()


@pytest.fixture(autouse=True, scope="module")
def warm_workers(request: pytest.FixtureRequest) -> Iterator[None]:
    """Worker processes are forks of one that has loaded what they need: the start of each would take 0.2 s."""
    with pytest.MonkeyPatch.context() as patch:
        if sys.platform == "linux" and request.path.stem not in STARTED:
            patch.setattr(processes, "subprocess", SimpleNamespace(**{**vars(subprocess), "Popen": warm.Worker}))
        yield


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A console of 200 columns. It is kept, and so must not be the one that later tests print on."""
    monkeypatch.setenv("COLUMNS", "200")
    consoles.cache_clear()
    yield
    consoles.cache_clear()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, without a sandbox, which root has not."""
    if BROWSER is None:
        pytest.skip("no Chromium to open a page in")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield opened
        opened.close()


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder that is made once for all workers."""
    base = factory.getbasetemp()
    out = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    with out.with_suffix(".lock").open("a+b") as file:
        while not locks.lock(file):
            time.sleep(0.1)
        if not out.is_dir():
            make(out.with_suffix(".part"))
            out.with_suffix(".part").rename(out)
    return out


def build(out: Path, options: Sequence[str] = ()) -> None:
    """The FMU of every component. Another process does it, as FMUs should be built before they are loaded."""
    done = subprocess.run(
        [sys.executable, str(ROOT / "build_fmus.py"), "--out", str(out), *options],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python FMUs; those in the folder `GAPSENSE_BUILT`, which `make` has just built, need not be built again."""
    ready = os.environ.get("GAPSENSE_BUILT")
    return once(tmp_path_factory, "fmus", partial(shutil.copytree, ROOT / ready) if ready else build)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Maker of folders that all workers have together."""
    return partial(once, tmp_path_factory)


@pytest.fixture(scope="session")
def natives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native FMUs, for this machine only; likewise those in the folder `GAPSENSE_NATIVES`."""
    try:
        compilers(*choose_platforms(["here"]))
    except NativeError as error:
        pytest.skip(f"no C compiler for native FMUs: {error}")
    ready = os.environ.get("GAPSENSE_NATIVES")
    make = partial(shutil.copytree, ROOT / ready) if ready else partial(build, options=("--platforms", "here"))
    return once(tmp_path_factory, "natives", make)


@pytest.fixture(scope="session")
def quickest(request: pytest.FixtureRequest) -> Path:
    """FMUs for tests that any will do for: native ones, or Python ones where there is no compiler."""
    try:
        return Path(request.getfixturevalue("natives"))
    except pytest.skip.Exception:
        return Path(request.getfixturevalue("fmus"))


@pytest.fixture(scope="session")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native FMUs for all platforms; likewise those in the folder `GAPSENSE_RELEASED`."""
    if zig_version() != ZIG:
        pytest.skip(f"no ziglang {ZIG}, which compiles for other platforms")
    ready = os.environ.get("GAPSENSE_RELEASED")
    make = partial(shutil.copytree, ROOT / ready) if ready else partial(build, options=["--native"])
    return once(tmp_path_factory, "everywhere", make)
