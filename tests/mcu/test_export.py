"""A component as C gives on a computer what the Python kernel gives, whichever of its outputs are wanted."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from host import ROOT, expected, played

from gapsense.embedded.design import designed
from gapsense.fmi.components import find_components, load_component

FOLDERS = {folder.name: folder for folder in find_components(ROOT / "fmus")}


@pytest.fixture(params=FOLDERS)
def folder(request: pytest.FixtureRequest) -> Path:
    return FOLDERS[request.param]


def some_outputs(folder: Path, seed: int) -> list[str]:
    names = [port.name for port in load_component(folder).of("output")]
    rng = random.Random(f"{folder.name} {seed}")
    return rng.sample(names, rng.randrange(1, len(names)))


def test_double_has_the_bits_of_the_python_kernel(folder: Path, tmp_path: Path) -> None:
    design = designed(folder, "double")
    assert same(played(design, tmp_path), expected(design))


@pytest.mark.parametrize("is_baked", [False, True])
def test_so_has_a_choice_of_outputs(folder: Path, tmp_path: Path, is_baked: bool) -> None:
    design = designed(folder, "double", some_outputs(folder, 1), is_baked=is_baked)
    assert same(played(design, tmp_path), expected(design))


def same(a: list[list[float]], b: list[list[float]]) -> bool:
    return bool(np.array_equal(np.array(a), np.array(b), equal_nan=True))
