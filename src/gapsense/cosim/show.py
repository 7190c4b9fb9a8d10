"""Results and scenarios for people to see. Only here does this layer reach up, to `report`, and only when asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gapsense.cosim.result.metrics import Measured, Vector


def plot(result: Any, patterns: Sequence[str]) -> Any:
    """Figure of the signals that match the patterns, or of all."""
    from gapsense.report import plot

    return plot.signals(result, patterns)


def frame(columns: Mapping[str, Any], name: str, index: Any, units: Mapping[str, str]) -> Any:
    """Columns as a DataFrame of pandas, with an index of that name."""
    from gapsense.report import pages

    return pages.frame(columns, name, index, units)


def scenario_html(tables: Mapping[str, Any], line: str) -> str:
    """Scenario as HTML, for notebooks; `line` says in one line what it is."""
    from gapsense.report import pages

    return pages.of_scenario(tables, line)


def result_html(
    title: str, line: str, metrics: Mapping[str, Measured], signals: Mapping[str, Vector], units: Mapping[str, str]
) -> str:
    """Result as HTML."""
    from gapsense.report import pages

    return pages.of_result(title, line, metrics, signals, units)


def sweep_html(line: str, quantiles: Mapping[str, Sequence[float]], units: Mapping[str, str]) -> str:
    """Sweep as HTML."""
    from gapsense.report import pages

    return pages.of_sweep(line, quantiles, units)


def convergence_text(found: Any) -> str:
    """What a study of the base step has found, as the command prints it."""
    from gapsense.report import convergence
    from gapsense.report.table import text

    return text(*convergence.shown(found))


def convergence_figure(found: Any) -> Any:
    """Figure of the errors over the base step."""
    from gapsense.report import convergence

    return convergence.figure(found)
