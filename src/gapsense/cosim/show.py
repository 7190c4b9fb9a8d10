"""Results and scenarios for people to see. Only here does this layer reach up, to `report`, and only when asked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def plot(result: Any, patterns: Sequence[str]) -> Any:
    """Figure of the signals that match the patterns, or of all."""
    from gapsense.report import plot

    return plot.signals(result, patterns)


def frame(shown: Any) -> Any:
    """Result or sweep as a DataFrame of pandas."""
    from gapsense.report import frames

    return frames.frame(shown)


def html(shown: Any) -> str:
    """Scenario, result or sweep as HTML, for notebooks."""
    from gapsense.report import pages

    return pages.html(shown)
