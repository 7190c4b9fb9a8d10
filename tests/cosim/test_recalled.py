"""What an FMU says of itself is read once by all processes, and again if anything about it has changed."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from gapsense.cosim.fmu import descriptions
from gapsense.cosim.fmu.descriptions import describe

OWN = Path(__file__).parents[2] / "build" / "fmus"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GAPSENSE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def readings(monkeypatch):
    """The FMU files that were read."""
    read: list[Path] = []
    anew = descriptions.read_anew
    monkeypatch.setattr(descriptions, "read_anew", lambda path, *more: (read.append(path), anew(path, *more))[1])
    return read


@pytest.mark.parametrize("name", ["Types.fmu", "Tuned.fmu", "Faulty.fmu"])
def test_kept_description_is_that_of_the_file(fmus, cache, readings, name):
    assert describe(fmus / name) == describe(fmus / name)
    assert readings == [fmus / name]
    assert describe(fmus / name).path == fmus / name


@pytest.mark.parametrize("name", ["Mhe.fmu", "RunToRun.fmu", "DriveVoltage.fmu"])
def test_rules_are_kept_too(cache, readings, name):
    first, second = describe(OWN / name), describe(OWN / name)
    assert first == second and first.rules == second.rules and first.rules is not None and len(readings) == 1
    assert all(isinstance(port.choices, tuple) and isinstance(port.columns, tuple) for port in second.rules.ports)


def test_arrays_are_kept_for_each_size(foreign, cache, readings):
    sizes = [{}, {"n": 3}, {}, {"n": 3}]
    found = [describe(foreign / "Arrays.fmu", of) for of in sizes]
    assert found[0] == found[2] and found[1] == found[3] and found[0] != found[1] and len(readings) == 2


def test_copy_is_known_and_a_changed_file_is_not(fmus, cache, readings, tmp_path):
    (tmp_path / "a.fmu").write_bytes((fmus / "Gain.fmu").read_bytes())
    assert describe(fmus / "Gain.fmu").variables == describe(tmp_path / "a.fmu").variables and len(readings) == 1
    (tmp_path / "a.fmu").write_bytes((fmus / "Lag.fmu").read_bytes())
    assert describe(tmp_path / "a.fmu").name == "Lag" and len(readings) == 2


def change(file: Path) -> None:
    file.write_bytes(file.read_bytes().replace(b"Gain", b"Lain"))


def allow(file: Path) -> None:
    content = file.read_bytes()[32:].replace(b"Gain", b"Lain")
    file.write_bytes(hashlib.sha256(content).digest() + content)
    file.chmod(0o666)


def empty(file: Path) -> None:
    file.write_text("")


@pytest.mark.parametrize("damage", [change, empty, *([allow] if os.name == "posix" else [])])
def test_damaged_file_and_one_that_others_can_write_are_not_believed(fmus, cache, readings, damage):
    describe(fmus / "Gain.fmu")
    (kept,) = cache.glob("fmu-*")
    damage(kept)
    assert describe(fmus / "Gain.fmu").name == "Gain" and len(readings) == 2
    assert describe(fmus / "Gain.fmu").name == "Gain" and len(readings) == 2


def test_without_a_cache_folder_the_file_is_read_each_time(fmus, tmp_path, monkeypatch, readings):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("GAPSENSE_CACHE", str(tmp_path / "file" / "cache"))
    assert describe(fmus / "Gain.fmu") == describe(fmus / "Gain.fmu") and len(readings) == 2


def test_what_nobody_has_used_for_long_is_removed(fmus, cache):
    describe(fmus / "Gain.fmu")
    (old,) = cache.glob("fmu-*")
    os.utime(old, (0, 0))
    describe(fmus / "Lag.fmu")
    assert not old.exists() and len(list(cache.glob("fmu-*"))) == 1
