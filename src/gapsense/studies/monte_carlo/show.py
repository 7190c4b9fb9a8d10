"""Figures 9 and 10 of [RTS] and their numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.files import Columns
from gapsense.report import plot
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE
from gapsense.report.table import table
from gapsense.studies.monte_carlo.comparison import (
    ESTIMATORS,
    OPERATIONS,
    QUANTITIES,
    Comparison,
    Study,
    operation_of,
    positions,
    trajectories,
)
from gapsense.studies.smoother.batch import MOVING

STYLES = dict(zip(ESTIMATORS, ((SECOND, "s"), (FIRST, "o"), (THIRD, "^"), ("#8250df", "v"), (FAINT, "x"))))
CASES = [(q, o) for q in range(len(QUANTITIES)) for o in range(len(OPERATIONS))]
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


def worst_case(study: Study, found: Comparison, k: int) -> Figure:
    """Fig. 10: positions in the worst run of the ERTSS at width `k`, in both operations."""
    worst = found.worst[k]
    title = (
        f"Worst of {found.runs} runs at {100 * found.widths[k]:g} %: NRMSE of the ERTSS "
        f"{worst.nrmse:.3f} in the {OPERATIONS[worst.operation]}"
    )
    runs = trajectories(study, found.widths[k], found.tunings[k], worst)
    z, t = positions(study.samples, study.model), 1e3 * study.samples.time
    figure, axes = plot.panels(title, 1, len(OPERATIONS), size=(9.0, 3.8), sharey=True)
    for o, axis in enumerate(axes[0]):
        moving = np.array([k for k in _moving(study) if operation_of(study.samples, k) == o])
        shown = slice(max(0, moving[0] - 8), moving[-1] + 9)
        axis.plot(t[shown], z[shown], color=TRUE, linewidth=2.2, label="reference")
        for name, values in runs.items():
            axis.plot(t[moving], values[moving], color=STYLES[name][0], linewidth=1.1, label=name)
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
    names = [(e, o, q) for e in range(len(ESTIMATORS)) for o in range(len(OPERATIONS)) for q in range(len(QUANTITIES))]
    errors = {f"{ESTIMATORS[e]}, {OPERATIONS[o]}, {QUANTITIES[q]}": found.nrmse[:, e, o, q] for e, o, q in names}
    return {"width": np.array(found.widths), **errors}


def _moving(study: Study) -> list[int]:
    return np.flatnonzero(study.samples.mode == MOVING).tolist()


def _count(cases: Any) -> str:
    return f"{int(np.sum(cases))} of {np.size(cases)} cases"
