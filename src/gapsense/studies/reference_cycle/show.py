"""Figure 5 of [RTS]: a cycle with soft landing."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gapsense.actuators.motion import MOVING
from gapsense.report import plot
from gapsense.studies.soft_landing.phases import Cycle

PANELS = (  # label, field, factor
    ("position / mm", "position", 1e3),
    ("flux / uWb", "flux", 1e6),
    ("current / mA", "current", 1e3),
    ("voltage / V", "voltage", 1.0),
)
THIN, WIDE = 1.0, 3.0  # at rest and in motion


def figure(cycle: Cycle) -> Figure:
    """Position, flux, current and voltage over time, and flux over field; the wide lines are the motions."""
    drawn = Figure(figsize=(11.0, 6.5), layout="constrained")
    grid = drawn.add_gridspec(len(PANELS), 2, width_ratios=(1.5, 1.0))
    first = None
    for k, (label, name, factor) in enumerate(PANELS):
        axis = drawn.add_subplot(grid[k, 0], sharex=first)
        first = first or axis
        _panel(axis, f"({'abcd'[k]}) {label}", 1e3 * cycle.time, factor * getattr(cycle, name), cycle.mode == MOVING)
        axis.tick_params(labelbottom=k == len(PANELS) - 1)
    axis.set_xlabel("time / ms")
    loop = drawn.add_subplot(grid[:, 1])
    _panel(loop, "(e) flux / uWb", 1e-3 * cycle.core_field, 1e6 * cycle.flux, cycle.mode == MOVING)
    loop.set_xlabel("field in the core / (kA/m)")
    drawn.suptitle("Soft landing: making and breaking without impact, as in Fig. 5 of [RTS]")
    drawn.align_ylabels()
    return drawn


def _panel(axis: Any, label: str, x: Any, y: Any, is_moving: Any) -> None:
    axis.plot(x, y, color=plot.FIRST, linewidth=THIN)
    for rows in np.split(np.arange(x.size), np.flatnonzero(np.diff(is_moving)) + 1):
        if is_moving[rows[0]]:
            axis.plot(x[rows], y[rows], color=plot.FIRST, linewidth=WIDE, solid_capstyle="butt")
    axis.set_ylabel(label)
    plot.dress(axis)
