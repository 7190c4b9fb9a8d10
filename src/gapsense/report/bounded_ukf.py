"""Figures 8 and 9 of [UKF], with what the paper leaves out: other filters, other voltages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gapsense.report.figures import FAINT, FIRST, SECOND, THIRD
from gapsense.studies.bounded_ukf import VOLTAGES, Errors
from gapsense.studies.bounded_ukf_report import PARTS

STYLES = {
    "bounded UKF, robust": {"color": FIRST, "marker": "o"},
    "bounded UKF, paper": {"color": SECOND, "marker": "s"},
    "bounded EKF": {"color": THIRD, "marker": "^", "linestyle": "--"},
    "open loop": {"color": FAINT, "marker": "x"},
}


def over_noise(found: Mapping[str, Errors], levels: Sequence[float]) -> Figure:
    """Fig. 8: rms error over the seeds, over the noise."""
    curves = {name: np.sqrt(np.mean(e.rmse**2, axis=2)) for name, e in found.items()}
    return _drawn("Right parameters: [UKF] Fig. 8", curves, levels, "noise $\\sigma_n$ (37)", "rms error / µm")


def over_errors(found: Mapping[str, Errors], errors: Sequence[float]) -> Figure:
    """Fig. 9: the worst of the sign combinations, over the relative error of six parameters."""
    curves = {name: e.rmse.max(axis=2) for name, e in found.items()}
    percent = [100 * x for x in errors]
    title = "Worst signs of six wrong parameters: [UKF] Fig. 9"
    return _drawn(title, curves, percent, "relative error of the parameters / %", "largest rms error / µm")


def _drawn(title: str, curves: Mapping[str, Any], x: Sequence[float], xlabel: str, ylabel: str) -> Figure:
    """One panel per part of the cycle and voltage; the unbounded filter lies far above all of them."""
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    axes = figure.subplots(len(PARTS), len(VOLTAGES), sharex=True, sharey=True)
    for p, part in enumerate(PARTS):
        for j, volts in enumerate(VOLTAGES):
            axis = axes[p, j]
            for name, style in STYLES.items():
                axis.loglog(x, 1e6 * curves[name][:, j, p], label=name, markersize=4, linewidth=1.2, **style)
            axis.set_title(f"{part}, {volts:g} V", fontsize="medium")
            axis.grid(True, which="both", color="#d0d7de", linewidth=0.4)
            axis.spines[["top", "right"]].set_visible(False)
        axes[p, 0].set_ylabel(ylabel)
    for axis in axes[-1]:
        axis.set_xlabel(xlabel)
    figure.suptitle(title)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(STYLES), frameon=False)
    return figure
