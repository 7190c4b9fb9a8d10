"""Results and scenarios for people to see. Only here does this layer reach up, to `report`, and only when asked."""

from __future__ import annotations

from types import ModuleType


def pages() -> ModuleType:
    """What makes HTML for notebooks, and tables of pandas."""
    from gapsense.report import pages

    return pages


def plots() -> ModuleType:
    """What draws figures."""
    from gapsense.report import plot

    return plot
