"""The figure of a scenario: `run_figure` of the study that its key `figure` names, or all signals stacked by unit."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from matplotlib.figure import Figure

from gapsense import studies
from gapsense.cosim import Result
from gapsense.report import plot


def draw(result: Result, kind: str) -> Figure:
    """The figure of a run."""
    return drawer(kind)(result)


def drawer(kind: str) -> Callable[[Result], Figure]:
    """What draws the figures of a kind; a ValueError tells what there is, before a long run."""
    name = f"{studies.__name__}.{kind}.show"
    found: Any = None
    if kind == "overview":
        found = plot.overview
    elif name in studies.modules("show"):
        found = getattr(import_module(name), "run_figure", None)
    if found is None:
        names = (name for name in studies.modules("show") if hasattr(import_module(name), "run_figure"))
        known = ", ".join(["overview", *(name.split(".")[-2] for name in names)])
        raise ValueError(f"the scenario asks for figure `{kind}`; there are {known}. Correct its key `figure`.")
    return found  # type: ignore[no-any-return]
