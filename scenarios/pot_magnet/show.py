"""Figures 8 to 11 of [HEKF], RMS deviations over time and over the noise, and the numbers behind them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report import plot
from gapsense.report.table import table

from .deviations import EDGE, LEVELS, SAMPLES, T_S, Array, Case, Deviations

Found = Mapping[Case, Deviations]
STYLES: Mapping[str, Any] = {  # of the tunings
    "robust": {"label": "robust", "color": plot.FIRST},
    "paper": {"label": "paper", "color": plot.SECOND},
    "none": {"label": "open loop", "color": plot.THIRD, "linestyle": "--"},
}
QUANTITIES = (("current / mA", 1e3), ("position / um", 1e6), ("velocity / (mm/s)", 1e3), ("mode", 1.0))
DRAWN = slice(EDGE - 30, EDGE + 320)  # around the edge
SMALLEST = 1e-3  # of the logarithmic axes, in these units: no gaps where a deviation is zero


def tables(found: Found, orientation: str, seeds: int) -> list[Table | str]:
    """RMSD over the seeds and the time after the edge, and the share of samples with the wrong mode."""
    shown: list[Table | str] = [
        f"RMSD over {seeds} seeds and {1e3 * T_S * (SAMPLES - EDGE):g} ms after the edge, {orientation} orientation",
        "[HEKF] shows Figs. 8-11 as curves and prints no numbers.",
    ]
    heads = ("noise of the current / mA", *(f"{1e3 * level:g}" for level in LEVELS))
    for (step, errors), tunings in by_column(found).items():
        rows = [
            (f"{name}, {STYLES[tuning]['label']}", *(f"{factor * x:.3g}" for x in one.total[:, k]))
            for k, (name, factor) in enumerate(QUANTITIES)
            for tuning, one in tunings.items()
        ]
        for tuning, one in tunings.items():
            shares = (f"{100 * x:.3g}" for x in one.wrong.mean(axis=1))
            rows.append((f"wrong mode / %, {STYLES[tuning]['label']}", *shares))
        shown.append(table(f"{step}, {errors}", heads, rows))
    return shown


def over_time(found: Found, noise: float = 1e-2) -> Figure:
    """RMSD of current, position, velocity and mode after the edge, at one level of noise."""
    level = int(np.argmin(np.abs(np.log(np.divide(LEVELS, noise)))))
    title = f"RMSD over the seeds, {1e3 * LEVELS[level]:g} mA of noise on the current"
    times = 1e3 * T_S * (np.arange(SAMPLES, dtype=float)[DRAWN] - EDGE)
    style = {"drawstyle": "steps-post"}
    return _drawn(found, title, "time after the edge / ms", times, lambda one: one.rmsd[level, DRAWN], style)


def over_noise(found: Found) -> Figure:
    """RMSD over seeds and time against the noise of the current."""
    title = "RMSD over the seeds and 100 ms"
    levels = np.multiply(1e3, LEVELS)
    figure = _drawn(found, title, "noise of the current / mA", levels, lambda one: one.total, {"marker": "."})
    figure.axes[0].set_xscale("log")  # and the others, which share it
    return figure


def by_column(found: Found) -> dict[tuple[str, str], dict[str, Deviations]]:
    """Deviations of all tunings, by the step of the voltage and the errors of the parameters."""
    columns: dict[tuple[str, str], dict[str, Deviations]] = {}
    for case, one in found.items():
        errors = f"parameters wrong by up to {100 * case.mismatch:g} %" if case.mismatch else "right parameters"
        columns.setdefault((case.step, errors), {})[case.tuning] = one
    return columns


def _drawn(
    found: Found, title: str, xlabel: str, x: Array, values: Callable[[Deviations], Array], style: Mapping[str, Any]
) -> Figure:
    """A row of panels per quantity; `values` has the curves of all quantities in its columns."""
    columns, size = by_column(found), (10.0, 9.0)
    figure, axes = plot.panels(title, len(QUANTITIES), len(columns), size, sharex=True, sharey="row")
    for axis, (label, _) in zip(axes[:, 0], QUANTITIES):
        axis.set_ylabel(label)
    for column, (case, tunings) in zip(axes.T, columns.items()):
        column[0].set_title("\n".join(case), fontsize=9)
        column[-1].set_xlabel(xlabel)
        for tuning, one in tunings.items():
            for axis, (_, factor), y in zip(column, QUANTITIES, values(one).T):
                axis.semilogy(x, np.maximum(factor * y, SMALLEST), linewidth=1.0, **STYLES[tuning], **style)
    plot.legend_below(figure)
    return figure
