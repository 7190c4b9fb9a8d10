"""Figures 7 and 8 of [RTS] and their numbers."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report.plot import FIRST, SECOND, Vector
from gapsense.report.table import add_row
from gapsense.report.table import table as new_table
from gapsense.studies.consistency.errors import BOUND, INTERVAL, PUBLISHED, STATES, Band, Consistency
from gapsense.studies.monte_carlo.comparison import OPERATIONS


def squared(found: Consistency) -> Figure:
    """Fig. 7: mean and 5-95 % of NEES along both motions, with the 90 % interval of its theory."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    for axis, operation, name in zip(figure.subplots(1, 2, sharey=True), found.operations, OPERATIONS):
        _band(axis, operation.time, operation.nees)
        _bounds(axis, INTERVAL)
        axis.axhline(len(STATES), color=SECOND, linewidth=0.9, linestyle=":", label="its mean")
        axis.set(title=name, xlabel="time / ms", yscale="log")
    figure.axes[0].set_ylabel("NEES")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"Normalised estimation errors squared, {found.runs} runs")
    return figure


def single(found: Consistency) -> Figure:
    """Fig. 8: the same for the error of each state."""
    figure = Figure(figsize=(9.0, 9.0), layout="constrained")
    axes = figure.subplots(len(STATES), 2, sharex="col", sharey="row")
    for o, operation in enumerate(found.operations):
        for axis, band in zip(axes[:, o], operation.nee):
            _band(axis, operation.time, band)
            _bounds(axis, (-BOUND, BOUND))
        axes[0, o].set_title(OPERATIONS[o])
        axes[-1, o].set_xlabel("time / ms")
    for axis, state in zip(axes[:, 0], STATES):
        axis.set_ylabel(f"NEE of {state}")
    figure.align_ylabels()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(f"Normalised estimation errors, {found.runs} runs")
    return figure


def table(found: Consistency) -> Table:
    """Numbers beside the published."""
    made = new_table(
        f"Consistency of the ERTSS, {found.runs} runs",
        (
            "",
            "theory",
            "published",
            "this study",
        ),
    )
    add_row(
        made,
        "NEES inside the 90 % interval",
        "90 %",
        f"{100 * PUBLISHED['inside']:.2f} %",
        f"{100 * found.inside:.2f} %",
    )
    add_row(made, "mean NEES", f"{len(STATES)}", f"{PUBLISHED['mean']}", f"{found.mean:.4f}")
    first = f"{100 * found.inside_full_rank:.2f} %, {found.mean_full_rank:.4f}"
    add_row(made, "both without the first sample of each motion (rank 4)", "", "", first)
    for state, inside in zip(STATES, found.nee_inside):
        add_row(made, f"NEE of {state} within +-{BOUND:.3f}", "90 %", "", f"{100 * inside:.2f} %")
    return made


def _band(axis: Any, time: Vector, band: Band) -> None:
    axis.fill_between(
        1e3 * time, band.low, band.high, color=FIRST, alpha=0.25, linewidth=0, label="5 to 95 % of the runs"
    )
    axis.plot(1e3 * time, band.mean, color=FIRST, linewidth=1.2, label="mean")
    axis.grid(True, color="#d0d7de", linewidth=0.5)
    axis.spines[["top", "right"]].set_visible(False)
    axis.margins(x=0.01)


def _bounds(axis: Any, interval: Any) -> None:
    for value, label in zip(interval, ("90 % interval of the theory", None)):
        axis.axhline(value, color=SECOND, linewidth=0.9, linestyle="--", label=label)
