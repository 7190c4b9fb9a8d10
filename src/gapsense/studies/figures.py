"""The figure of a scenario: `run_figure` of the study that its key `figure` names, or all signals stacked by unit."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from matplotlib.figure import Figure

from gapsense import studies
from gapsense.cosim import Result
from gapsense.report import plot


def drawer(kind: str) -> Callable[[Result], Figure]:
    """What draws the figures of a kind; a ValueError tells what there is, before a long run."""
    if kind == "overview":
        return plot.overview
    shows = {name.split(".")[-2]: name for name in studies.modules("show")}
    found: Callable[[Result], Figure] | None = run_figure(shows[kind]) if kind in shows else None
    if found is None:
        kinds = ", ".join(["overview", *(other for other, name in shows.items() if run_figure(name))])
        raise ValueError(f"the scenario asks for figure `{kind}`; there are {kinds}. Correct its key `figure`.")
    return found


def run_figure(name: str) -> Callable[[Result], Figure] | None:
    """The function of that name in a study's `show.py`, if it has one."""
    return getattr(import_module(name), "run_figure", None)
