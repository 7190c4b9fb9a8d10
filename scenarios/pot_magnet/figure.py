"""Figures 4 to 7 of [HEKF] from a run of its scenario: the magnet and its filters around the edge of the voltage."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, legend, line, require_recorded, stack

LABELS = ["voltage / V", "current / mA", "position / mm", "velocity\n/ (mm/s)", "mode"]
SIGNALS = (  # of the magnet, of its filters, factor for display
    ("current", "current_estimated", 1e3),
    ("position", "position", 1e3),
    ("velocity", "velocity", 1e3),
    ("mode", "mode", 1.0),
)
FILTERS = {"paper": ("paper", SECOND, "-"), "robust": ("robust", FIRST, "-"), "open_loop": ("open loop", THIRD, "--")}
BEFORE, AFTER = 3e-3, 32e-3  # what is drawn, around the last edge of the voltage [s]


def run_figure(result: Result) -> Figure:
    """Voltage, then current, position, velocity and mode: true, and by every filter of the run."""
    filters = {name: style for name, style in FILTERS.items() if name in result.run.components}
    estimates = [f"{name}.{estimate}" for name in filters for _, estimate, _ in SIGNALS]
    truths = [f"magnet.{truth}" for truth, _, _ in SIGNALS]
    require_recorded(result, ["drive.voltage", "sensor.current_measured", *truths, *estimates])
    figure, axes = stack(f"{result.run.title}, {result.run.scenario}", LABELS, [0.6, 1.2, 1.0, 1.0, 1.0])
    edge = last_edge(result)
    rows = np.flatnonzero((result.times >= edge - BEFORE) & (result.times <= edge + AFTER))
    t = result.times[rows]
    line(axes[0], t, result["drive.voltage"][rows], TRUE)
    measured = 1e3 * result["sensor.current_measured"][rows]
    axes[1].plot(1e3 * t, measured, ".", color=FAINT, markersize=2, label="measured")
    for axis, (truth, estimate, factor) in zip(axes[1:], SIGNALS):
        line(axis, t, factor * result[f"magnet.{truth}"][rows], TRUE, "true", linewidth=4.0, alpha=0.3)
        for name, (label, color, dashes) in filters.items():
            line(axis, t, factor * result[f"{name}.{estimate}"][rows], color, label, linestyle=dashes)
    axes[4].set_yticks(range(5), ["0 rest", "1 lifting", "2 contact", "3 upper", "4 falling"], fontsize="small")
    legend(axes[1])
    return figure


def last_edge(result: Result) -> float:
    """Time of the last change of the voltage [s]; the start if there is none."""
    changes = np.flatnonzero(np.diff(result["drive.voltage"]))
    return float(result.times[changes[-1] if changes.size else 0])
