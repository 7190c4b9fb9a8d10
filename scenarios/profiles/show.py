"""Section IV-F of [RTS] from runs of the scenario `profiles`: its numbers, and Figures 12, 14 and 15."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.cosim import Result
from gapsense.report import plot
from gapsense.report.plot import FAINT, FIRST, SECOND, TRUE, Vector, line
from gapsense.report.table import table

from .experiment import ESTIMATORS, OPERATIONS, SIGNALS, Errors, Profile, line_up, moved

LEVELS = (5.0, 25.0, 50.0, 75.0, 95.0)  # of the box plots [%]
PUBLISHED = {"position": 0.1, "velocity": 130.0}  # 75 % of the errors of the ERTSS are smaller, about
UNITS = {"position": "", "velocity": "1/s"}  # of what is normalised
ALIKE = 1e-2  # difference of positions, in strokes, by which two motions are the same
CHOSEN = "ERTSS"  # the estimator that the paper gives numbers of
MARGIN = 0.5  # time shown before and after an operation [ms]
MEDIAN = {"color": "red"}
OUTSIDE = {"marker": ".", "markersize": 1.5, "markeredgecolor": FAINT}


def summary(profiles: Sequence[Profile], errors: Errors) -> list[Table | str]:
    """How many motions there were, percentiles of the absolute errors, and what the paper says of the smoother."""
    return [*counts(profiles), *percentiles(errors), *published(errors)]


def counts(profiles: Sequence[Profile]) -> Iterator[str]:
    """Motions by operation, what became of them, and how many differ from each other."""
    yield f"{len(profiles)} profiles"
    for operation in OPERATIONS:
        found = [m for profile in profiles for m in moved(profile, operation)]
        back, late = sum(m.returns for m in found), sum(not m.published for m in found)
        samples = sum(m.landed - m.first for m in found)
        yield (
            f"  {operation}: {len(found) - back} motions from stop to stop, {different(profiles, operation)} of them "
            f"different; {back} back to the stop they left; {samples} samples"
        )
        yield f"    {late} were not yet published completely when the run ended, and are smoothed from the record"
    worst = max((profile.difference for profile in profiles), default=0.0)
    yield f"  largest difference between what was published and the same from the records: {worst:.3g}"


def different(profiles: Sequence[Profile], operation: str) -> int:
    """Number of motions from stop to stop of which none before was the same within `ALIKE`."""
    known: list[Vector] = []
    for profile in profiles:
        for m in moved(profile, operation):
            z = profile.true.position[m.first : m.landed]
            is_known = any(z.size == other.size and np.max(np.abs(z - other)) < ALIKE for other in known)
            if not m.returns and not is_known:
                known.append(z)
    return len(known)


def percentiles(errors: Errors) -> Iterator[Table]:
    """A table for each quantity, one row per operation and estimator."""
    heads = ["operation", "estimator", *(f"{level:g} %" for level in LEVELS)]
    for quantity, of_quantity in zip(UNITS, errors):
        rows = []
        for operation, estimator in product(OPERATIONS, ESTIMATORS):
            values = of_quantity[estimator, operation]
            numbers = np.percentile(values, LEVELS) if values.size else np.full(len(LEVELS), np.nan)
            rows.append([operation, estimator, *(f"{number:.4g}" for number in numbers)])
        yield table(_label(f"Absolute error of the {quantity}", quantity), heads, rows, texts=2)


def published(errors: Errors) -> Iterator[str]:
    """Share of the smoother's errors below the limits that the paper gives for about 75 % of them."""
    for (quantity, limit), of_quantity in zip(PUBLISHED.items(), errors):
        values = np.concatenate([of_quantity[CHOSEN, operation] for operation in OPERATIONS])
        share = 100.0 * np.mean(values < limit) if values.size else np.nan
        told = f"{CHOSEN}, {quantity} errors smaller than {limit:g} {UNITS[quantity]}".rstrip()
        yield f"{told}: published about 75 %, here {share:.1f} %"


def run_figure(result: Result) -> Figure:
    """Figure 12: one cycle, and its making and breaking with reference and estimates; positions normalised."""
    plot.require_recorded(result, SIGNALS)
    profile = line_up(result)
    figure: Any = Figure(figsize=(9.0, 8.5), layout="constrained")
    figure.suptitle(f"{result.run.scenario}: {result.run.title}")
    upper, lower = figure.subfigures(2, 1, height_ratios=[3.0, 2.4])
    axes, below = upper.subplots(3, 1, sharex=True), lower.subplots(1, 2, sharey=True)
    measured = result["sensor.voltage_measured"], 1e3 * result["sensor.current_measured"]
    labels = "voltage / V", "current / mA", "position"
    for axis, values, label in zip(axes, (*measured, profile.true.position), labels):
        plot.dress(axis)
        line(axis, result.times, values, TRUE)
        axis.set_ylabel(label)
    axes[2].set(xlabel="time / ms", xlim=(0.0, 1e3 * result.times[-1]))
    upper.align_ylabels(axes)
    mode = axes[2].twinx()
    line(mode, result.times, profile.mode, FAINT, linestyle="--")
    mode.set_yticks([1, 2, 3])
    mode.set_ylabel("mode", color=FAINT)
    mode.spines["top"].set_visible(False)
    for axis, operation in zip(below, OPERATIONS):
        plot.dress(axis)
        estimated(axis, profile, operation)
    below[0].set_ylabel("position")
    below[1].legend(frameon=False, fontsize="small")
    return figure  # type: ignore[no-any-return]


def estimated(axis: Any, profile: Profile, operation: str) -> None:
    """Position in one operation: reference, filter, and smoother in motion."""
    found = moved(profile, operation)
    axis.set_title(operation, fontsize="medium")
    axis.set_xlabel("time / ms")
    if not found:
        return
    t = 1e3 * profile.time
    axis.set_xlim(t[found[0].first] - MARGIN, t[found[-1].landed] + MARGIN)
    axis.plot(t, profile.true.position, TRUE, linewidth=1.0, label="reference")
    axis.plot(t, profile.estimates["EKF"].position, SECOND, linewidth=1.0, label="EKF")
    for k, m in enumerate(found):
        rows = slice(m.first, m.landed)
        label = None if k else "ERTSS"
        axis.plot(t[rows], profile.estimates["ERTSS"].position[rows], FIRST, linewidth=1.5, linestyle="--", label=label)


def trajectories(profiles: Sequence[Profile], title: str) -> Figure:
    """Figure 14: positions and velocities of all profiles, making and breaking; both normalised."""
    figure, axes = _panels(title, "", sharex="col", sharey="row")
    for column, operation in zip(axes.T, OPERATIONS):
        column[1].set_xlabel("time / ms")
        for profile in profiles:
            found = moved(profile, operation)
            rows = slice(found[0].first - 1, found[-1].landed + 1) if found else slice(0)
            for axis, values in zip(column, profile.true):
                axis.plot(1e3 * profile.time[rows], values[rows], color=FIRST, linewidth=0.6, alpha=0.5)
    return figure


def boxes(errors: Errors, title: str) -> Figure:
    """Figure 15: absolute errors; boxes from 25 to 75 %, whiskers from 5 to 95 %, medians red, the rest as points."""
    figure, axes = _panels(title, " error", sharex=True)
    for row, of_quantity in zip(axes, errors):
        for axis, operation in zip(row, OPERATIONS):
            values = [of_quantity[estimator, operation] for estimator in ESTIMATORS]
            axis.boxplot(values, whis=(LEVELS[0], LEVELS[-1]), widths=0.6, medianprops=MEDIAN, flierprops=OUTSIDE)
            axis.set_xticks(range(1, len(ESTIMATORS) + 1), ESTIMATORS)
    return figure


def _panels(title: str, what: str, **more: Any) -> tuple[Figure, Any]:
    """A row of panels for each quantity, a column for each operation."""
    figure, axes = plot.panels(title, len(UNITS), len(OPERATIONS), size=(9.0, 6.0), **more)
    for axis, quantity in zip(axes[:, 0], UNITS):
        axis.set_ylabel(_label(f"{quantity}{what}", quantity))
    for axis, operation in zip(axes[0], OPERATIONS):
        axis.set_title(operation, fontsize="medium")
    return figure, axes


def _label(what: str, quantity: str) -> str:
    return f"{what} / ({UNITS[quantity]})" if UNITS[quantity] else what
