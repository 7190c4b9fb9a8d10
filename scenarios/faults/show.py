"""Runs of the scenario of faults side by side: their currents, estimates and health, and their metrics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.cosim import Result
from gapsense.report.plot import FIRST, SECOND, THIRD, TRUE, legend_below, line, panels, require_recorded, shade
from gapsense.report.table import quantity, table

LABELS = ("current / mA", "position / mm", "resistance / Ohm", "health")
MEASURED = "#8250df"
COLORS = {"ertss": FIRST, "mhe": SECOND, "semera": THIRD}
NEEDED = (
    *("actuator.current", "actuator.position", "semera.current", "semera.resistance", "mhe.resistance"),
    *("ertss.position", "mhe.position", "ertss.health", "mhe.health", "semera.health"),
)
SHOWN = 37e-3  # time [s] from which on runs are drawn: an operation before most faults is enough
MARGIN = 1.3  # of the true current, so that noise does not make the rest small


def run_figure(result: Result) -> Figure:
    """One run."""
    return side_by_side({result.run.variant or "no fault": result}, result.run.title)


def side_by_side(results: Mapping[str, Result], title: str) -> Figure:
    """A column for each run: what the estimators get for the current, their positions and resistances, their health."""
    for result in results.values():
        require_recorded(result, NEEDED)
    size = (1.2 + 1.56 * max(3, len(results)), 7.0)
    figure, axes = panels(title, len(LABELS), len(results), size=size, sharex=True, sharey="row")
    for column, (name, result) in enumerate(results.items()):
        column_of(axes[:, column], result)
        axes[0, column].set_title(name)
        axes[-1, column].set_xlabel("time / ms")
    for axis, label in zip(axes[:, 0], LABELS):
        axis.set_ylabel(label)
    figure.align_ylabels()
    limits(axes, [*results.values()])
    legend_below(figure)
    return figure


def column_of(axes: Sequence[Any], result: Result) -> None:
    """One run, from above to below."""
    current, position, resistance, health = axes
    t = result.times
    line(current, t, 1e3 * result["semera.current"], MEASURED, "measured", linewidth=0.7)
    line(current, t, 1e3 * result["actuator.current"], TRUE, "true")
    line(position, t, 1e3 * result["actuator.position"], TRUE, linewidth=2.0)
    for k, (name, color) in enumerate(COLORS.items()):
        if name != "semera":
            line(position, t, 1e3 * result[f"{name}.position"], color)
        if name != "ertss":
            line(resistance, t, result[f"{name}.resistance"], color)
        health.fill_between(1e3 * t, k, k + 0.8 * result[f"{name}.health"], color=color, step="post", linewidth=0.0)
    for name, color in COLORS.items():
        current.plot([], [], color=color, label=name.capitalize())
    health.set_yticks([k + 0.4 for k in range(len(COLORS))], [name.capitalize() for name in COLORS])
    for axis in axes:
        shade(axis, result)


def limits(axes: Any, results: Sequence[Result]) -> None:
    """The same time and the same ranges for all runs."""
    times = results[0].times
    axes[0, 0].set_xlim(1e3 * max(times[0], SHOWN), 1e3 * times[-1])
    largest = 1e3 * max(float(np.abs(result["actuator.current"]).max()) for result in results)
    axes[0, 0].set_ylim(-0.3 * largest, MARGIN * largest)


def metrics_table(results: Mapping[str, Result]) -> Table:
    """A row for each run with its metrics."""
    measured = next(iter(results.values())).metrics
    heads = ["fault", *(m.label for m in measured.values())]
    rows = [[name, *(said(m.value, m.unit) for m in result.metrics.values())] for name, result in results.items()]
    return table("Estimators under faults; a time is counted from the beginning of the fault", heads, rows)


def said(value: float, unit: str) -> str:
    """A metric; a time that never came is infinite."""
    return "never" if math.isinf(value) else quantity(value, unit)
