"""The study in figures: impact speeds over cycles, motions cycle by cycle, energies, all conditions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gapsense.report import plot

from .comparison import Found
from .conditions import CONDITIONS
from .cycles import EVERY, Outcome
from .loops import LAWS
from .measures import LAST, LEVELS, OPERATIONS, Floats, impact_energy, quantile

Outcomes = Mapping[str, Outcome]  # by law
COLORS = {
    "ordinary": plot.FAINT,
    "nominal": "#8250df",
    "nelder-mead": plot.THIRD,
    "fisher": "#bf8700",
    "contact": plot.FIRST,
    "model": plot.SECOND,
    "both": "#1b7c83",
}
TICKS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
BOUNDS = (0.04, 2.2)  # of the axes of speeds [m/s]
STRIP = ("ordinary", "contact", "model")  # laws whose motions are drawn, if they are there
ACTUATORS, CYCLES = 2, 4  # of them, the last one and the first ones


def speeds(title: str, outcomes: Outcomes) -> Figure:
    """A panel for each law: median, 10 to 90 % and worst of the actuators over the cycles."""
    size = (1.2 + 1.3 * max(3, len(outcomes)), 6.0)
    figure, axes = plot.panels(title, len(OPERATIONS), len(outcomes), size, sharex=True, sharey=True)
    for column, (law, outcome) in zip(axes.T, outcomes.items()):
        column[0].set_title(LAWS[law].title.replace(", ", ",\n"), fontsize="medium")
        column[-1].set_xlabel("cycle")
        column[-1].locator_params(axis="x", integer=True)
        for axis, values in zip(column, np.swapaxes(outcome.speeds, 0, 1)):
            _banded(axis, values, COLORS[law])
    for axis, operation in zip(axes[:, 0], OPERATIONS):
        axis.set_ylabel(f"{operation}: impact speed / (m/s)")
        _speeds(axis)
    plot.legend_below(figure)
    return figure


def _banded(axis: Any, values: Floats, color: str) -> None:
    """Quantiles over the cycles, of (cycles, runs)."""
    cycles = np.arange(len(values))
    low, middle, high, worst = np.quantile(values, (0.1, 0.5, 0.9, 1.0), axis=1)
    axis.fill_between(cycles, low, high, color=color, alpha=0.25, linewidth=0, label="10 to 90 %")
    axis.plot(cycles, middle, color=color, linewidth=1.5, label="median")
    axis.plot(cycles, worst, ".", color=color, markersize=3, label="worst (2: did not arrive)")


def _speeds(axis: Any) -> None:
    axis.set_yscale("log")
    axis.set_ylim(*BOUNDS)
    axis.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axis.minorticks_off()


def energies(title: str, outcomes: Outcomes) -> Figure:
    """Energy supplied, and energy of the impacts, over the cycles: means with quartiles."""
    figure, axes = plot.panels(title, 1, 2, (plot.PAGE, 4.2), sharex=True)
    for law, outcome in outcomes.items():
        parts = (1e3 * outcome.energy, 1e6 * impact_energy(outcome))
        for axis, values in zip(axes[0], parts):
            cycles, (low, middle, high) = np.arange(len(values)), np.quantile(values, (0.25, 0.5, 0.75), axis=1)
            axis.fill_between(cycles, low, high, color=COLORS[law], alpha=0.2, linewidth=0)
            axis.plot(cycles, middle, color=COLORS[law], linewidth=1.5, label=LAWS[law].title)
            axis.set_xlabel("cycle")
    axes[0, 0].set_ylabel("energy supplied per cycle / mJ")
    axes[0, 1].set_ylabel("energy of both impacts / uJ")
    axes[0, 1].set_yscale("log")
    plot.legend_below(figure)
    return figure


def motions(title: str, outcomes: Outcomes) -> Figure:
    """A film strip: rows are actuators, columns cycles."""
    drawn = {law: outcomes[law].motions for law in STRIP if law in outcomes} or {
        law: outcome.motions for law, outcome in outcomes.items()
    }
    every = sorted(next(iter(drawn.values())), key=int)
    cycles = [*every[: CYCLES - 1], every[-1]] if len(every) > CYCLES else every
    rows = min(ACTUATORS, next(iter(drawn.values()))[cycles[0]].shape[1])
    size = (1.0 + 2.0 * len(cycles), 1.2 + 1.9 * rows)
    figure, axes = plot.panels(f"{title}: gap of {rows} actuators", rows, len(cycles), size, sharex=True, sharey=True)
    for column, cycle in zip(axes.T, cycles):
        column[0].set_title(f"cycle {cycle}", fontsize="medium")
        column[-1].set_xlabel("time / ms")
        for law, of in drawn.items():
            for axis, z in zip(column, of[cycle].T):
                axis.plot(
                    1e3 * EVERY * np.arange(z.size), 1e3 * z, color=COLORS[law], linewidth=1.2, label=LAWS[law].title
                )
    for axis in axes[:, 0]:
        axis.set_ylabel("gap / mm")
    plot.legend_below(figure)
    return figure


def over_conditions(found: Found) -> Figure:
    """The last cycles of all conditions: median, 90 % and 99 % of closings and openings."""
    names = [*dict.fromkeys(name for name, _ in found.outcomes)]
    size = (plot.PAGE, 2.0 + 0.4 * len(names))
    figure, axes = plot.panels(f"Last {LAST} cycles: median, 90 %, 99 %", 1, 2, size, sharex=True, sharey=True)
    for law in LAWS:
        of = [(k, found.outcomes[name, law]) for k, name in enumerate(names) if (name, law) in found.outcomes]
        for axis, values in zip(axes[0], np.swapaxes([_levels(outcome) for _, outcome in of], 0, 2) if of else ()):
            places = np.array([k for k, _ in of]) + 0.12 * ([*LAWS].index(law) - 0.5 * len(LAWS))
            axis.hlines(places, values[0], values[-1], color=COLORS[law], linewidth=1.5)
            axis.plot(values[0], places, "o", color=COLORS[law], markersize=5, label=LAWS[law].title)
            axis.plot(values[1], places, "|", color=COLORS[law], markersize=8)
    for axis, operation in zip(axes[0], OPERATIONS):
        axis.set_xlabel(f"{operation}: impact speed / (m/s)")
        axis.set_xscale("log")
        axis.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
        axis.minorticks_off()
    axes[0, 0].set_yticks(range(len(names)), [CONDITIONS[name].title for name in names])
    axes[0, 0].invert_yaxis()
    plot.legend_below(figure)
    return figure


def _levels(outcome: Outcome) -> Floats:
    """Quantiles of the last cycles, (levels, operations)."""
    return np.array([quantile(outcome.speeds[-LAST:], level) for level in [*LEVELS][:-1]])
