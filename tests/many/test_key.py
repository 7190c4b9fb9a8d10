"""The key of what was computed: what changes it, and what does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense.many import provenance as of


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of two files, in place of ours."""
    (tmp_path / "part").mkdir()
    (tmp_path / "one.py").write_text("x = 1\n")
    (tmp_path / "part" / "two.c").write_text("int y;\n")
    monkeypatch.setattr(of, "PACKAGE", tmp_path)
    return tmp_path


def test_same_facts_and_sources_have_the_same_key(package):
    assert of.key({"a": 1, "b": 2.0}) == of.key({"b": 2.0, "a": 1}) != of.key({"a": 1, "b": 3.0})


@pytest.mark.parametrize(
    ("name", "text"), [("one.py", "x = 2\n"), ("part/two.c", "int z;\n"), ("part/new.py", ""), ("part/new.h", "")]
)
def test_changed_or_new_source_changes_the_key(package, name, text):
    before = of.key("facts")
    (package / name).write_text(text)
    assert of.key("facts") != before


def test_renamed_source_changes_the_key(package):
    before = of.key("facts")
    (package / "one.py").rename(package / "three.py")
    assert of.key("facts") != before


@pytest.mark.parametrize("name", ["__pycache__/one.cpython-310.pyc", "one.py~", "notes.txt"])
def test_what_is_no_source_leaves_the_key(package, name):
    before = of.key("facts")
    (package / name).parent.mkdir(exist_ok=True)
    (package / name).write_text("x")
    assert of.key("facts") == before


def test_examples_inside_an_installed_package_and_packages_beside_it_leave_the_key(package, monkeypatch):
    monkeypatch.setattr(of, "INSTALLED", package / "_shipped")
    before = of.key("facts")
    for folder in (package / "_shipped" / "scenarios", package.parent / "another_package"):
        folder.mkdir(parents=True)
        (folder / "more.py").write_text("x = 1\n")
    assert of.key("facts") == before


def test_components_change_the_key(package, monkeypatch, tmp_path_factory):
    before = of.key("facts")
    monkeypatch.setattr(of, "COMPONENTS", tmp_path_factory.mktemp("fmus"))
    assert of.key("facts") != before


def test_other_numpy_changes_the_key(package, monkeypatch):
    before = of.key("facts")
    monkeypatch.setattr(np, "__version__", "0.0")
    assert of.key("facts") != before


def test_our_package_has_sources():
    names = set(of.sources())
    files = ("many/provenance.py", "cosim/result/metrics.py", "actuators/motion.py", "cosim/run/loop/loop.c")
    assert {f"gapsense/{file}" for file in files} <= names
    assert {"fmus/ekf/component.py", "fmus/ekf/fringing_29.csv"} <= names  # studies take their start values
    assert "scenarios/soft_landing/study.py" in names and "scenarios/soft_landing/baseline.csv" not in names
    assert not [name for name in names if "pycache" in name]
