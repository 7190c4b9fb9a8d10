"""The components of the project, found in fmus/."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import pytest
from drivers import ROOT

from gapsense.fmi.components import find_components
from gapsense.fmi.ports import Component

# Bytes of a native FMU for two platforms: checks of indices cost some 5 %, our own exp, log and tanh 3 %, tables over
# two variables 1 %, stops on which the mover of `Mhe` bounces 4 %, its sharper knee 1 %, noise in `RunToRun` 2 %, its
# openings that float .4 %, its coils that drift, hits that nobody hears and closings that float 2 %, its plans that
# wait, closings that stall and faint hits 7 %.
LARGEST = 445e3
FOLDERS = find_components(ROOT / "fmus")


FEW = ("drive_voltage", "ertss", "sensor", "solenoid_valve")  # with a table, large memory, noise, and none of these
EASY = [f.name for f in FOLDERS if f.name != "mhe"]  # in Python: `Mhe` takes 5 s there, and its native FMU is quick


def some(*normal: str) -> list[Any]:
    """All components; those that are not named only in the long tests."""
    slow = pytest.mark.slow
    return [pytest.param(f, id=f.name, marks=() if f.name in normal else slow) for f in FOLDERS]


class Part(NamedTuple):
    """One component."""

    folder: Path
    component: Component
    path: Path  # of its FMU

    def names(self, causality: str) -> list[str]:
        return [p.name for p in self.component.of(causality)]


def tuned(component: Component) -> dict[str, float]:
    """Other values for all parameters that may be changed during a run."""
    tunable = [p for p in component.of("parameter") if p.variability == "tunable"]
    return {p.name: 1.0625 * p.start if p.max is None else min(1.0625 * p.start, p.max) for p in tunable}


def sample_time(component: Component) -> float:
    """Of a sampled component, else 0."""
    return next((float(p.start) for p in component.ports if p.name == "sample_time"), 0.0)
