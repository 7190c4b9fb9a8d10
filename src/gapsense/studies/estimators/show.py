"""Figure of the benchmark of all estimators: errors by condition."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, legend, line, recorded, stack
from gapsense.studies.estimators.measures import CONTENDERS, Contender, estimate, learnt, lined_up, signals
from gapsense.studies.estimators.text import CONDITIONS, Runs, values

PANELS = {"position": ("position / um", 1e6), "flux_linkage": ("flux linkage / mWb", 1e3)}
COLORS = dict(
    zip(
        (c.label for c in CONTENDERS),
        (FAINT, FIRST, "#54aeff", "#bf8700", SECOND, THIRD, "#4ac26b", "#8250df", "#cf222e", "#1b7c83"),
    )
)
SHAPES = dict(zip(COLORS, "ospD^v<PX*"))
SPACING = 0.11  # between the estimators of a condition


def conditions(found: Mapping[str | None, Runs]) -> Figure:
    """Root mean square errors: dots are medians over the runs, lines reach from the best to the worst run."""
    figure = Figure(figsize=(11.5, 7.0), layout="constrained")
    axes = figure.subplots(len(PANELS), 1, sharex=True)
    shown = [c for c in CONDITIONS if c.variant in found]
    for axis, (quantity, (title, factor)) in zip(axes, PANELS.items()):
        giving = [c for c in CONTENDERS if quantity in c.gives]
        for k, contender in enumerate(giving):
            at = np.arange(len(shown)) + SPACING * (k - 0.5 * (len(giving) - 1))
            errors = [factor * values(found[c.variant], contender, quantity) for c in shown]
            dots(axis, at, errors, contender)
        styled(axis, f"RMS error of the {title}", len(shown))
    axes[-1].set_xticks(range(len(shown)), [c.title for c in shown], fontsize="small")
    figure.suptitle("All estimators on the same actuator: median of the runs, from the best to the worst")
    return figure


def dots(axis: Any, at: Any, errors: list[Any], contender: Contender) -> None:
    """One estimator in all conditions."""
    color = COLORS[contender.label]
    axis.vlines(at, [e.min() for e in errors], [e.max() for e in errors], color=color, linewidth=1.5, alpha=0.6)
    axis.plot(
        at,
        [np.median(e) for e in errors],
        SHAPES[contender.label],
        color=color,
        markersize=6,
        label=contender.label,
        linestyle="none",
    )


def styled(axis: Any, title: str, count: int) -> None:
    """A logarithmic axis, bands that part the conditions, a legend beside."""
    axis.set_yscale("log")
    axis.set_ylabel(title)
    axis.grid(True, axis="y", color="#d0d7de", linewidth=0.5)
    axis.spines[["top", "right"]].set_visible(False)
    axis.set_xlim(-0.5, count - 0.5)
    for k in range(0, count, 2):
        axis.axvspan(k - 0.5, k + 0.5, color="#f6f8fa", zorder=-1)
    legend(axis)


def run_figure(result: Result) -> Figure:
    """The second cycle of a run: voltage, current, positions and flux linkages of all estimators against the truth."""
    recorded(result, [*signals(), "sensor.voltage_measured", "sensor.current_measured"])
    title = f"{result.run.scenario}: {result.run.title}"
    labels = ["voltage / V", "current / A", "position / mm", "flux linkage / mWb"]
    figure, axes = stack(title, labels, [1.4, 1.4, 3.0, 3.0])
    line(axes[0], result.times, result["sensor.voltage_measured"], TRUE)
    line(axes[1], result.times, result["sensor.current_measured"], TRUE)
    for axis, quantity in zip(axes[2:], PANELS):
        estimates(axis, result, quantity)
        legend(axis)
    axes[3].set_ylim(-3.0, 1.4e3 * float(np.max(result["actuator.flux_linkage"])))
    axes[3].set_xlim(1e3 * learnt(result), 2e3 * learnt(result))
    return figure


def estimates(axis: Any, result: Result, quantity: str) -> None:
    """What the estimators say of one quantity, each estimate at the sample that it is about."""
    line(axis, result.times, 1e3 * result[f"actuator.{quantity}"], TRUE, "true", linewidth=2.5, alpha=0.35)
    for contender in CONTENDERS:
        found = estimate(result, contender, quantity)
        if found is not None:
            came, about = lined_up(result, contender)
            known = np.full(result.times.size, np.nan)
            known[about] = found[came]
            line(axis, result.times, 1e3 * known, COLORS[contender.label], contender.label)
