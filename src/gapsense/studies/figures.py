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
    shows = {name.split(".")[-2]: import_module(name) for name in studies.modules("show")}
    drawers = {name: show.run_figure for name, show in shows.items() if hasattr(show, "run_figure")}
    known: dict[str, Callable[[Result], Figure]] = {"overview": plot.overview, **drawers}
    if kind not in known:
        kinds = ", ".join(known)
        raise ValueError(f"the scenario asks for figure `{kind}`; there are {kinds}. Correct its key `figure`.")
    return known[kind]
