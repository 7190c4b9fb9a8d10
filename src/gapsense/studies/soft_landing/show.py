"""A cycle with soft landing in numbers; four estimators side by side, smoothed values at their own times."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.actuators.motion import CLOSED, MOVING, OPEN
from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, Vector, legend, line, recorded, stack
from gapsense.report.table import table
from gapsense.studies.soft_landing.phases import Cycle

SMOOTHERS = {
    "ertss": ("ERTSS", FIRST),
    "no_current_error": ("without e_i", THIRD),
    "no_force_error": ("without e_F", FAINT),
}
LABELS = ["voltage / V", "current / mA", "position / mm", "position\nerror / um", "velocity\nerror / (mm/s)"]
HEIGHTS = [1.0, 1.0, 1.5, 1.7, 1.7]
QUANTITIES = (("position", 1e6), ("velocity", 1e3))
LINTHRESH = 10.0  # errors are linear up to it, then logarithmic
RANGES = (  # heading, field, factor
    ("voltage / V", "voltage", 1.0),
    ("current / mA", "current", 1e3),
    ("flux / uWb", "flux", 1e6),
    ("core field / (A/m)", "core_field", 1.0),
)
MODES = {CLOSED: "closed", MOVING: "moving", OPEN: "open"}


class Smoothed(NamedTuple):
    """Smoothed values of the samples in motion, in the order of their times."""

    time: Vector
    values: Vector
    truth: Vector


def phases(cycle: Cycle) -> Table:
    """Range of voltage, current, flux and field in each phase."""
    rows = []
    for part in np.split(np.arange(cycle.time.size), np.flatnonzero(np.diff(cycle.time) == 0.0) + 1):
        begin, end = 1e3 * cycle.time[part[[0, -1]]]
        if end > begin:
            cells = (_range(factor * getattr(cycle, field)[part]) for _, field, factor in RANGES)
            rows.append([MODES[cycle.mode[part[0]]], f"{begin:.4g}", f"{end:.4g}", *cells])
    return table("", ["phase", "from / ms", "to / ms", *(heading for heading, _, _ in RANGES)], rows)


def run_figure(result: Result) -> Figure:
    """Measurements, position, and errors of all estimators."""
    names = (f"{n}.smoothed_{what}" for n in SMOOTHERS for what in ("published", "time", "position", "velocity"))
    truths = ("actuator.position", "actuator.velocity", "actuator.mode")
    recorded(result, ("drive.voltage", "sensor.current_measured", "ekf.position", "ekf.velocity", *truths, *names))
    drawn, (voltage, current, position, *errors) = stack(result.run.title, LABELS, HEIGHTS)
    rows = result.stepped("sensor.current_measured")
    t = result.times[rows]
    line(voltage, t, result["drive.voltage"][rows], TRUE)
    current.plot(1e3 * t, 1e3 * result["sensor.current_measured"][rows], ".", color=TRUE, markersize=1.5)
    line(position, t, 1e3 * result["ekf.position"][rows], SECOND, "EKF")
    line(position, t, 1e3 * result["actuator.position"][rows], TRUE, "true")
    for k, moving in enumerate(_motions(smoothed(result, "ertss", "position"))):
        position.plot(
            1e3 * moving.time, 1e3 * moving.values, "--", color=FIRST, linewidth=2.0, label=None if k else "ERTSS"
        )
    legend(position)
    for axis, (quantity, factor) in zip(errors, QUANTITIES):
        _errors(axis, result, quantity, factor)
    legend(errors[0])
    return drawn


def smoothed(result: Result, name: str, quantity: str) -> Smoothed:
    """What a smoother published, put back to the times it belongs to, beside the truth there."""
    rows = np.flatnonzero(result[f"{name}.smoothed_published"] > 0.5)
    at = result[f"{name}.smoothed_time"][rows]
    order = np.argsort(at, kind="stable")
    nearest = np.clip(np.searchsorted(result.times, at[order] - 1e-9), 0, result.times.size - 1)
    values = result[f"{name}.smoothed_{quantity}"][rows][order]
    return Smoothed(at[order], values, result[f"actuator.{quantity}"][nearest])


def _range(values: Vector) -> str:
    low, high = values.min(), values.max()
    return f"{low:.4g}" if high - low < 1e-9 else f"{low:.4g} to {high:.4g}"


def _motions(s: Smoothed) -> list[Smoothed]:
    """One piece per motion: between two there is a gap."""
    if s.time.size < 2:
        return [s]
    gaps = np.flatnonzero(np.diff(s.time) > 3.0 * np.min(np.diff(s.time))) + 1
    return [Smoothed(*pieces) for pieces in zip(*(np.split(column, gaps) for column in s))]


def _errors(axis: Any, result: Result, quantity: str, factor: float) -> None:
    moving = result["actuator.mode"] == MOVING
    error = np.where(moving, result[f"ekf.{quantity}"] - result[f"actuator.{quantity}"], np.nan)
    axis.plot(1e3 * result.times, factor * error, color=SECOND, linewidth=1.0, label="EKF")
    for name, (label, color) in SMOOTHERS.items():
        for k, piece in enumerate(_motions(smoothed(result, name, quantity))):
            error = factor * (piece.values - piece.truth)
            axis.plot(1e3 * piece.time, error, color=color, linewidth=1.0, label=None if k else label)
    axis.set_yscale("symlog", linthresh=LINTHRESH)
    axis.axhline(0.0, color=TRUE, linewidth=0.5)
