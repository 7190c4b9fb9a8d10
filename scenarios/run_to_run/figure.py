"""The figure of a run of the scenario `run_to_run`: motions of all cycles, and how hard they end."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from gapsense.control.judging import LOWER, UPPER
from gapsense.cosim import Result
from gapsense.report import plot

from .cycles import NEVER, hardest

ACTUATOR = ("actuator.position", "actuator.mode", "actuator.impact_speed")
SIGNALS = (*ACTUATOR, "controller.cycle", "controller.approach_speed")
AROUND = 1.1  # usual cycles that are shown of one that a rest makes longer
LIGHTEST = 0.8  # of the colours


def run_figure(result: Result) -> Figure:
    """Gap over the time since the cycle began, later cycles lighter; impact speeds and planned approaches by cycle."""
    plot.require_recorded(result, SIGNALS)
    figure, axes = plot.panels(result.run.title, 1, 2, (plot.PAGE, 4.4))
    parts = cycles(result)
    _motions(axes[0, 0], result, parts)
    _landings(axes[0, 1], result, parts)
    plot.legend_below(figure)
    return figure


def cycles(result: Result) -> list[slice]:
    """Samples of each cycle."""
    starts = np.flatnonzero(np.diff(result["controller.cycle"]) > 0.0) + 1
    return [slice(*ends) for ends in pairwise([*starts.tolist(), result.times.size])]


def _motions(axis: Any, result: Result, parts: list[slice]) -> None:
    for part, color in zip(parts, colormaps["viridis"](np.linspace(0.0, LIGHTEST, len(parts)))):
        times = result.times[part] - result.times[part.start]
        axis.plot(1e3 * times, 1e3 * result["actuator.position"][part], color=color, linewidth=0.8)
    usual = float(np.median([result.times[part][-1] - result.times[part.start] for part in parts]))
    axis.set_xlim(0.0, 1e3 * AROUND * usual)
    axis.set_xlabel("time since the cycle began / ms")
    axis.set_ylabel("gap / mm, later cycles lighter")


def _landings(axis: Any, result: Result, parts: list[slice]) -> None:
    impacts = np.array([_impacts(result, part) for part in parts])
    approach = result["controller.approach_speed"]
    planned = np.array([(approach[part][0], approach[part][-1]) for part in parts])
    for k, (operation, color) in enumerate((("closing", plot.FIRST), ("opening", plot.SECOND))):
        axis.plot(impacts[:, k], "o-", color=color, markersize=3, linewidth=1.0, label=f"{operation}, impact")
        axis.plot(planned[:, k], "--", color=color, linewidth=1.0, label=f"{operation}, approach as planned")
    axis.set_yscale("log")
    axis.set_xlabel("cycle")
    axis.locator_params(axis="x", integer=True)
    axis.set_ylabel("speed / (m/s)")


def _impacts(result: Result, part: slice) -> tuple[float, float]:
    """Hardest impacts of a closing and an opening, which begins where the mover was last on its lower stop."""
    mode, impact = (result[name][part, None] for name in ("actuator.mode", "actuator.impact_speed"))
    closed = np.flatnonzero(mode == LOWER)
    end = closed[-1] + 1 if closed.size else len(mode)
    opening = hardest(mode[end:], impact[end:], UPPER)[0] if end < len(mode) else NEVER
    return float(hardest(mode[:end], impact[:end], LOWER)[0]), float(opening)
