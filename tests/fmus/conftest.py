"""The components, found in fmus/, and their FMUs in all the states that the contract tests need."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # the helpers of this folder can be imported by its tests

from drivers import ROOT, break_kernel, fresh
from hosting import SLAVE, SLAVES, build_slaves
from parts import FEW, FOLDERS, Part, tuned

from gapsense.fmi.components import load_component

Shared = Callable[[str, Callable[[Path], object]], Path]


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def part(request: pytest.FixtureRequest, fmus: Path) -> Part:
    """Each component in turn."""
    component = load_component(request.param)
    return Part(request.param, component, fmus / f"{component.name}.fmu")


@pytest.fixture
def fmu(part: Part) -> str:
    """Path of the component's FMU."""
    return str(part.path)


@pytest.fixture(scope="session")
def all_fmus(fmus: Path) -> list[str]:
    """Paths of the FMUs of all components."""
    return [str(fmus / f"{load_component(folder).name}.fmu") for folder in FOLDERS]


@pytest.fixture
def group(request: pytest.FixtureRequest) -> tuple[str, list[Path]]:
    """The components that are built again together with that of the test: a few, or in the long tests all others."""
    is_long = "part" in request.fixturenames and request.getfixturevalue("part").folder.name not in FEW
    return "others" if is_long else "few", [f for f in FOLDERS if (f.name in FEW) != is_long]


@pytest.fixture
def rebuilt(shared: Shared, group: tuple[str, list[Path]]) -> Path:
    """Folder with the FMUs of a second build by another process, from elsewhere, with another seed of hashes."""

    def build(folder: Path) -> None:
        folder.mkdir()
        names = [load_component(each).name for each in group[1]]
        command = [sys.executable, str(ROOT / "build_fmus.py"), "--out", str(folder), *names]
        env = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "PYTHONHASHSEED": "12345"}
        subprocess.run(command, cwd=folder, env=env, check=True, capture_output=True)

    return shared(f"rebuilt-{group[0]}", build)


@pytest.fixture
def second(shared: Shared, group: tuple[str, list[Path]]) -> tuple[Path, dict[str, str]]:
    """Folder with a second version of the FMUs, and the parameter of each whose start value has changed."""

    def build(folder: Path) -> None:
        folder.mkdir()
        changed = fresh("build_second_versions", [str(f) for f in group[1]], folder, folder / "fmus")
        (folder / "changed.json").write_text(json.dumps(changed), encoding="utf-8")

    folder = shared(f"second-{group[0]}", build)
    return folder / "fmus", json.loads((folder / "changed.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def broken(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with FMUs whose kernels fail at their first steps."""
    folder = tmp_path_factory.mktemp("broken")
    for path in fmus.glob("*.fmu"):
        break_kernel(path, folder)
    return folder


@pytest.fixture
def life(fmu: str) -> dict[str, Any]:
    """Trace of one FMU, and what its signals follow."""
    return fresh("life", fmu)  # type: ignore[no-any-return]


@pytest.fixture
def saved(fmu: str, part: Part) -> dict[str, Any]:
    """A saved state, and how the run goes on."""
    return fresh("save", fmu, tuned(part.component))  # type: ignore[no-any-return]


@pytest.fixture
def elsewhere(fmu: str, saved: dict[str, Any]) -> dict[str, Any]:
    """How the run goes on from the saved state in another process, and the trace of one more instance there."""
    return fresh("elsewhere", fmu, saved["bytes"])  # type: ignore[no-any-return]


@pytest.fixture(scope="session")
def stock(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with `<name>.fmu` and the extracted `<name>/` of each slave in `SLAVES`, with our Linux binary."""
    scripts = {name: SLAVE.format(name=name, on_init=init, on_step=step) for name, (init, step) in SLAVES.items()}
    return build_slaves(tmp_path_factory.mktemp("stock"), scripts)


@pytest.fixture(scope="session")
def semera(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One of our own FMUs, extracted."""
    folder = tmp_path_factory.mktemp("extracted") / "Semera"
    with zipfile.ZipFile(fmus / "Semera.fmu") as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="session")
def gcc() -> str:
    """The compiler of the C host."""
    found = shutil.which("gcc")
    if found is None or sys.platform != "linux":
        pytest.skip("gcc on Linux compiles the C host")
    return found


@pytest.fixture(scope="session")
def c_host(gcc: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host of host.c."""
    from gapsense.fmi.shim.build import headers

    program, source = tmp_path_factory.mktemp("host") / "host", Path(__file__).with_name("host.c")
    warnings = ["-Wall", "-Wextra", "-Werror"]
    subprocess.run([gcc, *warnings, f"-I{headers()}", str(source), "-o", str(program), "-ldl", "-lpthread"], check=True)
    return program
