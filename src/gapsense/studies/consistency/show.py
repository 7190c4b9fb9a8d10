"""Figures 7 and 8 of [RTS] and their numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report import plot
from gapsense.report.plot import FIRST, SECOND, Vector
from gapsense.report.table import table
from gapsense.studies.consistency.errors import BOUND, INTERVAL, PUBLISHED, STATES, Band, Consistency
from gapsense.studies.monte_carlo.comparison import OPERATIONS


def squared(found: Consistency) -> Figure:
    """Fig. 7: mean and 5-95 % of NEES along both motions, with the 90 % interval of its theory."""
    title = f"Normalised estimation errors squared, {found.runs} runs"
    figure, axes = plot.panels(title, 1, len(OPERATIONS), size=(9.0, 3.6), sharey=True)
    for axis, operation, name in zip(axes[0], found.operations, OPERATIONS):
        _band(axis, operation.time, operation.nees, INTERVAL)
        axis.axhline(len(STATES), color=SECOND, linewidth=0.9, linestyle=":", label="its mean")
        axis.set(title=name, xlabel="time / ms", yscale="log")
    axes[0, 0].set_ylabel("NEES")
    plot.legend_below(figure)
    return figure


def single(found: Consistency) -> Figure:
    """Fig. 8: the same for the error of each state."""
    title, shape = f"Normalised estimation errors, {found.runs} runs", (len(STATES), len(OPERATIONS))
    figure, axes = plot.panels(title, *shape, size=(9.0, 9.0), sharex="col", sharey="row")
    for s, o in np.ndindex(shape):
        _band(axes[s, o], found.operations[o].time, found.operations[o].nee[s], (-BOUND, BOUND))
        axes[s, 0].set_ylabel(f"NEE of {STATES[s]}")
        axes[0, o].set_title(OPERATIONS[o])
        axes[-1, o].set_xlabel("time / ms")
    figure.align_ylabels()
    plot.legend_below(figure)
    return figure


def summary(found: Consistency) -> Table:
    """Numbers beside the published."""
    inside, full_rank = (f"{100 * part:.2f} %" for part in (found.inside, found.inside_full_rank))
    rows = [
        ["NEES inside the 90 % interval", "90 %", f"{100 * PUBLISHED['inside']:.2f} %", inside],
        ["mean NEES", f"{len(STATES)}", f"{PUBLISHED['mean']}", f"{found.mean:.4f}"],
        ["both without the first sample of each motion (rank 4)", "", "", f"{full_rank}, {found.mean_full_rank:.4f}"],
    ]
    for state, part in zip(STATES, found.nee_inside):
        rows.append([f"NEE of {state} within +-{BOUND:.3f}", "90 %", "", f"{100 * part:.2f} %"])
    return table(f"Consistency of the ERTSS, {found.runs} runs", ["", "theory", "published", "this study"], rows)


def _band(axis: Any, time: Vector, band: Band, interval: Any) -> None:
    """Mean and 5-95 % of the runs, and the interval of the theory."""
    label = "5 to 95 % of the runs"
    axis.fill_between(1e3 * time, band.low, band.high, color=FIRST, alpha=0.25, linewidth=0, label=label)
    axis.plot(1e3 * time, band.mean, color=FIRST, linewidth=1.2, label="mean")
    for value, name in zip(interval, ("90 % interval of the theory", None)):
        axis.axhline(value, color=SECOND, linewidth=0.9, linestyle="--", label=name)
