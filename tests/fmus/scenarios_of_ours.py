"""The scenarios that come with the package: each of their variants is read once by a process, which takes 20 ms."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from gapsense.cosim import Scenario, find_scenarios, load

ROOT = Path(__file__).resolve().parents[2]


@cache
def read(file: Path, variant: str | None = None) -> Scenario:
    return load(file, variant)


EVERY = [(file, v) for file in find_scenarios(ROOT / "scenarios") for v in (None, *read(file).variants)]
