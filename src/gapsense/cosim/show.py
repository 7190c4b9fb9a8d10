"""Results and scenarios for people to see. Only here does this layer reach up, to `report`, and only when asked."""

from __future__ import annotations

from types import ModuleType
from typing import Any


def pages() -> ModuleType:
    """What makes HTML for notebooks, and tables of pandas."""
    from gapsense.report import pages

    return pages


def plots() -> ModuleType:
    """What draws figures."""
    from gapsense.report import plot

    return plot


def convergence_text(found: Any) -> str:
    """What a study of the base step has found, as the command prints it."""
    from gapsense.report import convergence
    from gapsense.report.table import text

    return text(*convergence.tabulate(found))


def convergence_figure(found: Any) -> Any:
    """Figure of the errors over the base step."""
    from gapsense.report import convergence

    return convergence.figure(found)
