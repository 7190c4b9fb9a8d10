"""A cycle with soft landing in numbers and as Fig. 5 of [RTS]; four estimators beside each other."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.actuators.motion import CLOSED, MOVING, OPEN
from gapsense.cosim import Result
from gapsense.report.plot import (
    FAINT,
    FIRST,
    PAGE,
    SECOND,
    THIRD,
    TRUE,
    Vector,
    dress,
    legend,
    line,
    require_recorded,
    stack,
)
from gapsense.report.table import table

from .inverse import Cycle
from .phases import parts

SMOOTHERS = {
    "ertss": ("ERTSS", FIRST),
    "no_current_error": ("without e_i", THIRD),
    "no_force_error": ("without e_F", FAINT),
}
LABELS = ["voltage / V", "current / mA", "position / mm", "position\nerror / um", "velocity\nerror / (mm/s)"]
HEIGHTS = [1.0, 1.0, 1.5, 1.7, 1.7]
QUANTITIES = (("position", 1e6), ("velocity", 1e3))
LINTHRESH = 10.0  # errors are linear up to it, then logarithmic
SHOWN = {  # of a cycle: label and factor
    "voltage": ("voltage / V", 1.0),
    "current": ("current / mA", 1e3),
    "flux": ("flux / uWb", 1e6),
    "core_field": ("core field / (A/m)", 1.0),
    "position": ("position / mm", 1e3),
}
RANGES, PANELS = [*SHOWN][:4], ("position", "flux", "current", "voltage")
THIN, WIDE = 1.0, 3.0  # at rest and in motion
MODES = {CLOSED: "closed", MOVING: "moving", OPEN: "open"}


class Smoothed(NamedTuple):
    """Smoothed values of the samples in motion, in the order of their times."""

    time: Vector
    values: Vector
    truth: Vector


def phases(cycle: Cycle) -> Table:
    """Range of voltage, current, flux and field in each phase."""
    rows = []
    for part in parts(cycle):
        begin, end = 1e3 * cycle.time[part[[0, -1]]]
        if end > begin:
            cells = (_range(SHOWN[name][1] * getattr(cycle, name)[part]) for name in RANGES)
            rows.append([MODES[cycle.mode[part[0]]], f"{begin:.4g}", f"{end:.4g}", *cells])
    return table("", ["phase", "from / ms", "to / ms", *(SHOWN[name][0] for name in RANGES)], rows)


def figure(cycle: Cycle) -> Figure:
    """Fig. 5: position, flux, current and voltage over time, and flux over field; the wide lines are the motions."""
    drawn = Figure(figsize=(PAGE, 6.5), layout="constrained")
    grid = drawn.add_gridspec(len(PANELS), 2, width_ratios=(1.5, 1.0))
    first = None
    for k, name in enumerate(PANELS):
        axis = drawn.add_subplot(grid[k, 0], sharex=first)
        first = first or axis
        label, factor = SHOWN[name]
        _panel(axis, f"({'abcd'[k]}) {label}", 1e3 * cycle.time, factor * getattr(cycle, name), cycle.mode == MOVING)
        axis.tick_params(labelbottom=k == len(PANELS) - 1)
    axis.set_xlabel("time / ms")
    loop = drawn.add_subplot(grid[:, 1])
    _panel(loop, "(e) flux / uWb", 1e-3 * cycle.core_field, 1e6 * cycle.flux, cycle.mode == MOVING)
    loop.set_xlabel("field in the core / (kA/m)")
    drawn.suptitle("Soft landing: making and breaking without impact, as in Fig. 5 of [RTS]")
    drawn.align_ylabels()
    return drawn


def run_figure(result: Result) -> Figure:
    """Measurements, position, and errors of all estimators."""
    names = (f"{n}.smoothed_{what}" for n in SMOOTHERS for what in ("published", "time", "position", "velocity"))
    truths = ("actuator.position", "actuator.velocity", "actuator.mode")
    require_recorded(
        result, ("drive.voltage", "sensor.current_measured", "ekf.position", "ekf.velocity", *truths, *names)
    )
    drawn, (voltage, current, position, *errors) = stack(result.run.title, LABELS, HEIGHTS)
    rows = result.stepped("sensor.current_measured")
    t = result.times[rows]
    line(voltage, t, result["drive.voltage"][rows], TRUE)
    current.plot(1e3 * t, 1e3 * result["sensor.current_measured"][rows], ".", color=TRUE, markersize=1.5)
    line(position, t, 1e3 * result["ekf.position"][rows], SECOND, "EKF")
    line(position, t, 1e3 * result["actuator.position"][rows], TRUE, "true")
    for k, moving in enumerate(_motions(smoothed(result, "ertss", "position"))):
        label = None if k else "ERTSS"
        position.plot(1e3 * moving.time, 1e3 * moving.values, "--", color=FIRST, linewidth=2.0, label=label)
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


def _panel(axis: Any, label: str, x: Any, y: Any, is_moving: Any) -> None:
    axis.plot(x, y, color=FIRST, linewidth=THIN)
    axis.plot(x, np.where(is_moving, y, np.nan), color=FIRST, linewidth=WIDE, solid_capstyle="butt")
    axis.set_ylabel(label)
    dress(axis)


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
