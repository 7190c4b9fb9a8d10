"""Native FMUs, unpacked, and a host in C for them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "fmus")]  # helpers for the tests here

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


def run(*command: object) -> str:
    """What a command prints; it must end well."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
