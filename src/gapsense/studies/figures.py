"""The figure of a scenario: that of a study, which the key `figure` names, or all signals stacked by unit."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from gapsense._os.importable import imported
from gapsense.studies import modules

FIGURES = {"overview": "gapsense.report.plot:overview"}  # `module:function` by name; each study adds its own


def drawer(kind: str) -> Callable[[Any], Any]:
    """Function from a result to the figure of a kind; a ValueError tells what there is, before a long run."""
    for name in modules():
        import_module(name)
    if kind not in FIGURES:
        kinds = ", ".join(FIGURES)
        raise ValueError(f"the scenario asks for figure `{kind}`; there are {kinds}. Correct its key `figure`.")
    drawn: Callable[[Any], Any] = imported(FIGURES[kind])
    return drawn
