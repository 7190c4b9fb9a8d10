"""Figures 8 to 11 of [HEKF]: RMS deviations over time, and over the noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gapsense.report.plot import FIRST, SECOND, THIRD, line
from gapsense.studies.hybrid_ekf.deviations import EDGE, LEVELS, STEPS, T_S, Case, Deviations
from gapsense.studies.hybrid_ekf.text import TITLES

COLORS = {"robust": FIRST, "paper": SECOND, "none": THIRD}
LABELS = (("current / mA", 1e3), ("position / um", 1e6), ("velocity / (mm/s)", 1e3), ("mode", 1.0))
DRAWN = slice(EDGE - 30, EDGE + 320)  # around the edge
SMALLEST = 1e-3  # of the logarithmic axes, in the units above


def over_time(found: Mapping[Case, Deviations], noise: float = 1e-2) -> Figure:
    """RMSD of current, position, velocity and mode after the edge, at one level of noise."""
    level = int(np.argmin(np.abs(np.log(np.divide(LEVELS, noise)))))
    drawn, axes = _panels(found, f"RMSD over the seeds, {1e3 * LEVELS[level]:g} mA of noise on the current")
    for row, column, case, one in _curves(found):
        times = T_S * (np.arange(one.rmsd.shape[1])[DRAWN] - EDGE)
        line(axes[row][column], times, _visible(LABELS[row][1] * one.rmsd[level, DRAWN, row]), **_style(case))
    _finish(drawn, axes, "time after the edge / ms")
    return drawn


def over_noise(found: Mapping[Case, Deviations]) -> Figure:
    """RMSD over seeds and time against the noise of the current."""
    drawn, axes = _panels(found, "RMSD over the seeds and 100 ms")
    for row, column, case, one in _curves(found):
        values = _visible(LABELS[row][1] * one.total[:, row])
        axes[row][column].plot(np.multiply(1e3, LEVELS), values, marker=".", linewidth=1.0, **_style(case))
        axes[row][column].set_xscale("log")
    _finish(drawn, axes, "noise of the current / mA")
    return drawn


def _panels(found: Mapping[Case, Deviations], title: str) -> tuple[Figure, Any]:
    drawn = Figure(figsize=(10.0, 9.0), layout="constrained")
    drawn.suptitle(title)
    columns = [(step, mismatch) for step in STEPS for mismatch in dict.fromkeys(case.mismatch for case in found)]
    axes = drawn.subplots(len(LABELS), len(columns), sharex=True, sharey="row", squeeze=False)
    for axis, (step, mismatch) in zip(axes[0], columns):
        axis.set_title(
            f"{step}\n" + (f"parameters +-{100 * mismatch:g} %" if mismatch else "right parameters"), fontsize=9
        )
    return drawn, axes


def _curves(found: Mapping[Case, Deviations]) -> Any:
    """Row, column, case and deviations of every curve."""
    columns = list(dict.fromkeys(case[:2] for case in found))
    for case, one in found.items():
        for row in range(len(LABELS)):
            yield row, columns.index(case[:2]), case, one


def _style(case: Case) -> dict[str, Any]:
    return {
        "color": COLORS[case.tuning],
        "label": TITLES[case.tuning],
        "linestyle": "--" if case.tuning == "none" else "-",
    }


def _visible(values: Any) -> Any:
    """No gaps where a deviation is zero on a logarithmic axis."""
    return np.maximum(values, SMALLEST)


def _finish(drawn: Figure, axes: Any, label: str) -> None:
    for row, (name, _) in zip(axes, LABELS):
        row[0].set_ylabel(name)
        row[0].set_yscale("log")
        for axis in row:
            axis.grid(True, color="#d0d7de", linewidth=0.5)
            axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel(label)
    handles, labels = axes[0][0].get_legend_handles_labels()
    drawn.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
