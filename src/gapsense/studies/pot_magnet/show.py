"""Figures 4 to 7 of [HEKF] from a run of its scenario: the magnet and its filters around the edge of the voltage."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, legend, line, stack

LABELS = ["voltage / V", "current / mA", "position / mm", "velocity\n/ (mm/s)", "mode"]
FILTERS = {"paper": ("paper", SECOND, "-"), "robust": ("robust", FIRST, "-"), "open_loop": ("open loop", THIRD, "--")}
SIGNALS = {"current_estimated": "current", "position": "position", "velocity": "velocity", "mode": "mode"}
BEFORE, AFTER = 3e-3, 32e-3  # what is drawn, around the last edge of the voltage [s]


def run_figure(result: Result) -> Figure:
    """Voltage, then current, position, velocity and mode: true, and by every filter of the run."""
    missing = [name for name in needed(result) if name not in result.signals]
    if missing:
        raise ValueError(
            f"{result.run.scenario}: figure `pot_magnet` needs {', '.join(f'`{m}`' for m in missing)}, not recorded. "
            'Add them to `[record]`, or choose `figure = "overview"`.'
        )
    drawn, axes = stack(f"{result.run.title}, {result.run.scenario}", LABELS, [0.6, 1.2, 1.0, 1.0, 1.0])
    edge = last_edge(result)
    rows = np.flatnonzero((result.times >= edge - BEFORE) & (result.times <= edge + AFTER))
    t = result.times[rows]
    line(axes[0], t, result["drive.voltage"][rows], TRUE)
    axes[1].plot(
        1e3 * t, 1e3 * result["sensor.current_measured"][rows], ".", color=FAINT, markersize=2, label="measured"
    )
    for axis, (estimate, truth), factor in zip(axes[1:], SIGNALS.items(), (1e3, 1e3, 1e3, 1.0)):
        line(axis, t, factor * result[f"magnet.{truth}"][rows], TRUE, "true", linewidth=4.0, alpha=0.3)
        for name, (label, color, dashes) in FILTERS.items():
            if name in result.run.components:
                line(axis, t, factor * result[f"{name}.{estimate}"][rows], color, label, linestyle=dashes)
    axes[4].set_yticks(range(5), ["0 rest", "1 lifting", "2 contact", "3 upper", "4 falling"], fontsize="small")
    legend(axes[1])
    return drawn


def needed(result: Result) -> list[str]:
    """Signals that the figure shows."""
    filters = [f"{name}.{signal}" for name in FILTERS if name in result.run.components for signal in SIGNALS]
    return ["drive.voltage", "sensor.current_measured", *(f"magnet.{signal}" for signal in SIGNALS.values()), *filters]


def last_edge(result: Result) -> float:
    """Time of the last change of the voltage [s]; the start if there is none."""
    changes = np.flatnonzero(np.diff(result["drive.voltage"]))
    return float(result.times[changes[-1] if changes.size else 0])
