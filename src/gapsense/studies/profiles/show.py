"""Figures 12, 14 and 15 of [RTS] from runs of the scenario `profiles`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, TRUE, line, recorded
from gapsense.studies.profiles.experiment import ESTIMATORS, LEVELS, OPERATIONS, SIGNALS, Errors, Profile, line_up

MARGIN = 0.5e-3  # time shown before and after an operation [s]
MEDIAN = {"color": "red"}
OUTSIDE = {"marker": ".", "markersize": 1.5, "markeredgecolor": FAINT}


def run_figure(result: Result) -> Figure:
    """Figure 12: one cycle, and its making and breaking with reference and estimates; positions normalised."""
    recorded(result, SIGNALS)
    profile, end = line_up(result), 1e3 * result.times[-1]
    figure: Any = Figure(figsize=(9.0, 8.5), layout="constrained")
    figure.suptitle(f"{result.run.scenario}: {result.run.title}")
    upper, lower = figure.subfigures(2, 1, height_ratios=[3.0, 2.4])
    axes = upper.subplots(3, 1, sharex=True)
    line(axes[0], result.times, result["sensor.voltage_measured"], TRUE)
    line(axes[1], result.times, 1e3 * result["sensor.current_measured"], TRUE)
    line(axes[2], result.times, profile.true.position, TRUE)
    mode = axes[2].twinx()
    line(mode, result.times, profile.mode, FAINT, linestyle="--")
    mode.set_yticks([1, 2, 3])
    mode.set_ylabel("mode", color=FAINT)
    mode.spines["top"].set_visible(False)
    styled(axes, ["voltage / V", "current / mA", "position"])
    axes[2].set_xlabel("time / ms")
    axes[2].set_xlim(0.0, end)
    upper.align_ylabels(axes)
    below = lower.subplots(1, 2, sharey=True)
    for axis, operation in zip(below, OPERATIONS):
        estimated(axis, profile, operation)
    styled(below, ["position", ""])
    below[1].legend(frameon=False, fontsize="small")
    return figure  # type: ignore[no-any-return]


def estimated(axis: Any, profile: Profile, operation: str) -> None:
    """Position in one operation: reference, filter, and smoother in motion."""
    found = [m for m in profile.motions if m.operation == operation]
    axis.set_title(operation, fontsize="medium")
    axis.set_xlabel("time / ms")
    if not found:
        return
    t = 1e3 * profile.time
    axis.set_xlim(t[found[0].first] - 1e3 * MARGIN, t[found[-1].landed] + 1e3 * MARGIN)
    axis.plot(t, profile.true.position, TRUE, linewidth=1.0, label="reference")
    axis.plot(t, profile.estimates["EKF"].position, SECOND, linewidth=1.0, label="EKF")
    for k, m in enumerate(found):
        rows = slice(m.first, m.landed)
        label = None if k else "ERTSS"
        axis.plot(t[rows], profile.estimates["ERTSS"].position[rows], FIRST, linewidth=1.5, linestyle="--", label=label)


def trajectories(profiles: Sequence[Profile], title: str) -> Figure:
    """Figure 14: positions and velocities of all profiles, making and breaking; both normalised."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, operation in zip(axes.T, OPERATIONS):
        column[0].set_title(operation, fontsize="medium")
        column[1].set_xlabel("time / ms")
        for profile in profiles:
            found = [m for m in profile.motions if m.operation == operation]
            rows = slice(found[0].first - 1, found[-1].landed + 1) if found else slice(0)
            for axis, values in zip(column, profile.true):
                axis.plot(1e3 * profile.time[rows], values[rows], color=FIRST, linewidth=0.6, alpha=0.5)
    styled(axes[:, 0], ["position", "velocity / (1/s)"])
    styled(axes[:, 1], ["", ""])
    figure.suptitle(title)
    return figure


def boxes(errors: Errors, title: str) -> Figure:
    """Figure 15: absolute errors; boxes from 25 to 75 %, whiskers from 5 to 95 %, medians red, the rest as points."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    for row, of_quantity in zip(axes, errors):
        for axis, operation in zip(row, OPERATIONS):
            values = [of_quantity[estimator, operation] for estimator in ESTIMATORS]
            axis.boxplot(values, whis=(LEVELS[0], LEVELS[-1]), widths=0.6, medianprops=MEDIAN, flierprops=OUTSIDE)
            axis.set_xticks(range(1, len(ESTIMATORS) + 1), ESTIMATORS)
    for axis, operation in zip(axes[0], OPERATIONS):
        axis.set_title(operation, fontsize="medium")
    styled(axes[:, 0], ["position error", "velocity error / (1/s)"])
    styled(axes[:, 1], ["", ""])
    figure.suptitle(title)
    return figure


def styled(axes: Sequence[Any], labels: Sequence[str]) -> None:
    """Label the vertical axes, and give all a grid and no box."""
    for axis, label in zip(axes, labels):
        axis.set_ylabel(label)
        axis.grid(True, color="#d0d7de", linewidth=0.5)
        axis.spines["top"].set_visible(False)
        axis.margins(x=0.01)
