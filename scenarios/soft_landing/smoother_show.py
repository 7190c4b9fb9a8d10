"""Figures 7 to 10 of [RTS] and their numbers."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense._os.files import Columns
from gapsense.report import plot
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, Vector
from gapsense.report.table import table

from .comparison import ESTIMATORS, QUANTITIES, Comparison, positions, trajectories
from .consistency import BOUND, INTERVAL, PUBLISHED, STATES, Band, Consistency
from .setting import OPERATIONS, Study, moving

STYLES = dict(zip(ESTIMATORS, ((SECOND, "s"), (FIRST, "o"), (THIRD, "^"), ("#8250df", "v"), (FAINT, "x"))))
CASES = [*np.ndindex(len(QUANTITIES), len(OPERATIONS))]
WITHIN = 0.1  # width up to which ERTSS must be better than without e_i


def errors(found: Comparison) -> Figure:
    """Fig. 9: errors against the width of the parameter errors, a panel for each operation and quantity."""
    title, percent = f"Estimation errors, {found.runs} runs at each width", 100.0 * np.array(found.widths)
    figure, axes = plot.panels(title, len(QUANTITIES), len(OPERATIONS), size=(9.0, 6.6), sharex=True)
    for q, o in CASES:
        for e, (name, (color, marker)) in enumerate(STYLES.items()):
            style = {"color": color, "marker": marker, "markersize": 4, "linewidth": 1.1}
            axes[q, o].loglog(percent, found.nrmse[:, e, o, q], label=name, **style)
        axes[q, o].set(title=f"{OPERATIONS[o]}: {QUANTITIES[q]}")
        axes[q, o].set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
        axes[q, 0].set_ylabel(f"NRMSE of the {QUANTITIES[q]}")
        axes[-1, o].set_xlabel("width of the parameter errors / %")
    plot.legend_below(figure)
    return figure


def worst_case(study: Study, found: Comparison, at: int) -> Figure:
    """Fig. 10: positions in the worst run of the ERTSS at width `at`, in both operations."""
    worst = found.worst[at]
    title = (
        f"Worst of {found.runs} runs at {100 * found.widths[at]:g} %: NRMSE of the ERTSS "
        f"{worst.nrmse:.3f} in the {OPERATIONS[worst.operation]}"
    )
    runs = trajectories(study, found.widths[at], found.tunings[at], worst)
    z, t = positions(study.samples, study.model), 1e3 * study.samples.time
    figure, axes = plot.panels(title, 1, len(OPERATIONS), size=(9.0, 3.8), sharey=True)
    for o, axis in enumerate(axes[0]):
        k = moving(study.samples, o)
        shown = slice(max(0, k[0] - 8), k[-1] + 9)
        axis.plot(t[shown], z[shown], color=TRUE, linewidth=2.2, label="reference")
        for name, values in runs.items():
            axis.plot(t[k], values[k], color=STYLES[name][0], linewidth=1.1, label=name)
        axis.set(title=OPERATIONS[o], xlabel="time / ms")
    axes[0, 0].set_ylabel("normalised position")
    plot.legend_below(figure)
    return figure


def tables(found: Comparison) -> list[Table]:
    """NRMSE in percent: a table for each quantity and operation."""
    made = []
    for q, o in CASES:
        rows = (
            [f"{100 * width:g}", *(f"{100 * value:.3g}" for value in values[:, o, q])]
            for width, values in zip(found.widths, found.nrmse)
        )
        title = f"NRMSE of the {QUANTITIES[q]} in the {OPERATIONS[o]} / %, {found.runs} runs"
        made.append(table(title, ["width / %", *ESTIMATORS], rows))
    return made


def noises(found: Comparison) -> Table:
    """Process noise (60) of each width."""
    rows = []
    for width, t in zip(found.widths, found.tunings):
        cells = (1e6 * t.process_flux_linkage, 1e3 * t.process_current_error, 1e3 * t.process_force_error)
        rows.append([f"{100 * width:g}", *(f"{value:.4g}" for value in cells)])
    heads = ["width / %", "lambda / uWb", "e_i / mA", "e_F / mN"]
    return table("Process noise (60), standard deviations per sample", heads, rows)


def orderings(found: Comparison) -> list[str]:
    """What [RTS] says of the estimators, and how often it comes out; a case is a width, operation and quantity."""
    errors = {name: found.nrmse[:, e] for e, name in enumerate(ESTIMATORS)}
    better = {name: errors["ERTSS"] < errors[name] for name in ESTIMATORS}
    narrow = np.array(found.widths) <= WITHIN
    lines = [
        f"ERTSS better than EKF: {_count(better['EKF'])}",
        f"ERTSS better than without e_i up to {100 * WITHIN:g} %: {_count(better['ERTSS without e_i'][narrow])}",
        f"ERTSS better than the open loop: {_count(better['open loop'])}",
    ]
    for o, operation in enumerate(OPERATIONS):
        wins = [f"{100 * w:g}" for w, is_better in zip(found.widths, better["ERTSS without e_F"][:, o, 0]) if is_better]
        lines.append(
            f"ERTSS better than without e_F, position in the {operation}: at {', '.join(wins) or 'no width'} %"
        )
    return lines


def columns(found: Comparison) -> Columns:
    """All errors for a CSV file."""
    heads = map(", ".join, product(ESTIMATORS, OPERATIONS, QUANTITIES))
    return {"width": np.array(found.widths), **dict(zip(heads, found.nrmse.reshape(len(found.widths), -1).T))}


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


def _count(cases: Any) -> str:
    return f"{int(np.sum(cases))} of {np.size(cases)} cases"
