"""Every FMU that the folder fmus/ gives, as a Python FMU and as a native one."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.extend(str(Path(__file__).parents[1] / name) for name in ("conformance", "fmus", "native"))  # with helpers

from parts import FEW
from subjects import PLATFORM, Instance, Subject

from gapsense.fmi.components import find_components, load_component

ROOT = Path(__file__).parents[2]
FOLDERS = find_components(ROOT / "fmus")
KINDS = ("python", "native")
ALIKE = (  # of code that all FMUs share: with a few of them
    *("test_null_is_refused_with_a_sentence", "test_null_is_refused_with_a_sentence_by_fmi_3"),
    *("test_calls_are_allowed_in_their_phases_alone", "test_damaged_bytes_are_refused_and_change_nothing"),
    "test_calls_without_sense_end_nothing",
)
SECONDS = {  # with these, in Python, for what the others show
    "test_awkward_steps_run": ("play_actuator", "power_stage", "table_actuator"),
    "test_made_up_states_are_refused": ("ertss", "mhe"),
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes seconds for one component belongs to the long tests."""
    for item in items:
        name, _, case = item.name.partition("[")
        is_alike = name in ALIKE and not any(few in case for few in FEW)
        if is_alike or case.removesuffix("-python]") in SECONDS.get(name, ()):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def subjects(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[tuple[str, str], Subject]]:
    """Those that tests have asked for so far; every host must end cleanly."""
    found: dict[tuple[str, str], Subject] = {}
    yield found
    assert {key: subject.close() for key, subject in found.items()} == dict.fromkeys(found, 0)


@pytest.fixture(params=[(kind, folder) for kind in KINDS for folder in FOLDERS], ids=lambda p: f"{p[1].name}-{p[0]}")
def subject(request: Any, subjects: Any, tmp_path_factory: pytest.TempPathFactory) -> Subject:
    """Each FMU in turn."""
    kind, folder = request.param
    component = load_component(folder)
    path: Path = request.getfixturevalue({"python": "fmus", "native": "natives"}[kind]) / f"{component.name}.fmu"
    if kind == "python" and not has_own_binary(path):
        pytest.skip("pythonfmu's own binary, which ends an instance at its first refusal")
    if (kind, component.name) not in subjects:
        where = tmp_path_factory.mktemp(f"{component.name}-{kind}")
        subjects[kind, component.name] = Subject(component, kind, path, where)
    found: Subject = subjects[kind, component.name]
    return found


def has_own_binary(path: Path) -> bool:
    """True on Linux: elsewhere our Python FMUs have the binary of pythonfmu."""
    with zipfile.ZipFile(path) as archive:
        return PLATFORM == "linux64" and "binaries/linux64/pythonfmu-export.bin" not in archive.namelist()


@pytest.fixture
def one(subject: Subject) -> Iterator[Instance]:
    """A new instance."""
    instance = subject.new()
    yield instance
    instance.do("free")


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def native3(request: Any, natives: Path, tmp_path: Path) -> Subject:
    """Each native FMU of FMI 3.0 in turn."""
    component = load_component(request.param)
    return Subject(component, "native", natives / "fmi3" / f"{component.name}.fmu", tmp_path)
