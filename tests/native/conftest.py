"""Native FMUs, unpacked, and a host in C for them."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "fmus"))  # the helpers of both folders can be imported here
sys.path.insert(0, str(Path(__file__).parent))

from core import Core
from drivers import ROOT
from parts import FOLDERS, Part
from unpacked_native import Unpacked, compiled_host, unpack

from gapsense.fmi.components import load_component


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def part(request: pytest.FixtureRequest, natives: Path) -> Part:
    """Each component in turn, with its native FMU."""
    component = load_component(request.param)
    return Part(request.param, component, natives / f"{component.name}.fmu")


@pytest.fixture
def unpacked(part: Part, tmp_path: Path) -> Unpacked:
    """The native FMU of the component."""
    return unpack(part.path, tmp_path)


@pytest.fixture(scope="session")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plain host, for this machine."""
    return compiled_host(("cc",), tmp_path_factory.mktemp("host") / "host")


@pytest.fixture(scope="session")
def core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    """The C of a component with tables, function by function."""
    if not shutil.which("cc"):
        pytest.skip("no C compiler `cc`")
    return Core(ROOT / "fmus" / "drive_voltage", tmp_path_factory.mktemp("core"))
