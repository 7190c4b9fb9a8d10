"""Pictures and tables of how results differ from their references."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report.plot import FIRST, SECOND, TRUE, legend_below, line, panels, scale_axis
from gapsense.report.table import quantity, table

if TYPE_CHECKING:
    from gapsense.cosim.result.compare import Comparison, Difference

MOST = 6  # signals in a picture
LISTED = 5  # signals within their tolerance that are shown
AROUND = 15  # rows before and after the worst one in the view from near
WRONG = "#cf222e"


def figure(comparison: Comparison, title: str) -> Figure:
    """The signals that fail, or those nearest to the end of their tolerance, whole and around their worst row."""
    chosen = (comparison.failing or comparison.within)[:MOST]
    made, axes = panels(title, max(1, len(chosen)), 2, (13.0, 1.2 + 2.0 * max(1, len(chosen))))
    for difference, pair in zip(chosen, axes):
        worst = int(np.argmax(difference.counted))
        for axis, rows in zip(pair, (slice(None), slice(max(0, worst - AROUND), worst + AROUND + 1))):
            draw(axis, difference, rows)
    for axis in axes[-1]:
        axis.set_xlabel("time / ms")
    if chosen:
        legend_below(made)
    return made


def draw(axis: Any, difference: Difference, rows: slice) -> None:
    """Reference with its tube, the result, and the rows that fail."""
    times, bad = difference.times[rows], difference.failing[rows]
    shown, factor = scale_axis(difference.name, difference.unit, difference.reference)
    low, high = (factor * end[rows] for end in difference.tube)
    axis.fill_between(1e3 * times, low, high, step="post", color=SECOND, alpha=0.25, linewidth=0, label="tolerance")
    line(axis, times, factor * difference.reference[rows], TRUE, "reference", linewidth=1.8)
    line(axis, times, factor * difference.values[rows], FIRST, "result")
    axis.plot(1e3 * times[bad], factor * difference.values[rows][bad], ".", color=WRONG, label="fails", markersize=5)
    axis.set_ylabel(shown, fontsize="small")


def nearest(found: Sequence[Difference]) -> Table:
    """Signals within their tolerance that are nearest to its end."""
    rows = [
        (d.name, quantity(float(d.counted.max(initial=0.0)), d.unit), quantity(d.allowed, d.unit), f"{d.share:.3g}")
        for d in found
        if d.share
    ]
    return table("Within their tolerance", ("signal", "greatest difference", "allowed", "share"), rows[:LISTED])
