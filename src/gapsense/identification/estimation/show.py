"""Figure and table of estimators on a measured record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.identification.assumptions import listed, meanings
from gapsense.identification.estimation.run import Estimate
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.file import BY_NAME
from gapsense.report.plot import FIRST, SECOND, THIRD, TRUE, legend, line, stack, suited
from gapsense.report.table import quantity, table
from gapsense.tables import Value

QUANTITIES = {"position": "m", "flux_linkage": "Wb", "resistance": "Ohm", "inductance": "H"}  # of estimators
COLORS = (FIRST, SECOND, THIRD, "#8250df", "#9a6700", "#cf222e")
ASSUMED = "Assumed in the parameter file, not known: {}. What depends on them is as uncertain as they are."
THICKEST = 2.0  # points; thinner and thinner, so that estimates that coincide are all seen
SHOWN = (2.0, 98.0)  # percentiles of the estimates that the axes show at least


def tables(estimates: Sequence[Estimate]) -> list[Table | str]:
    """Last values of every estimator, and the parameters that were set."""
    rows, said = [], []
    for e in estimates:
        last = {q: quantity(float(e.outputs[q][-1]), u) for q, u in QUANTITIES.items() if q in e.outputs}
        rows.append([e.name, *(last.get(q, "") for q in QUANTITIES)])
        given = ", ".join(f"{name} = {value:.6g}" for name, value in e.values.items() if not isinstance(value, str))
        said.append(f"{e.name}: {given}")
        if e.unset:
            said.append(
                f"{e.name}, not given and so the component's own start values: {listed(e.unset, BY_NAME, e.unset)}."
            )
    return [table("Estimates at the end of the record", ("estimator", *QUANTITIES), rows), *said]


def repeated(values: Mapping[str, Value], assumed: Sequence[str]) -> list[str]:
    """What the parameter files mark as assumed, and what that means for the estimates."""
    return [ASSUMED.format(listed(values, BY_NAME, assumed)), *meanings(assumed)] if assumed else []


def measured_and_estimated(record: Record, estimates: Sequence[Estimate]) -> Figure:
    """What was measured, then one panel per estimated quantity with all estimators."""
    names = [q for q in QUANTITIES if any(q in e.outputs for e in estimates)]
    label, scale = suited("current", "A", record.current)
    scales = {name: _scale(estimates, name) for name in names}
    figure, axes = stack(record.name, ["voltage / V", label, *(label for label, _ in scales.values())])
    line(axes[0], record.times, record.voltage, TRUE)
    line(axes[1], record.times, scale * record.current, TRUE)
    for axis, name in zip(axes[2:], names):
        _panel(axis, record, estimates, name, scales[name][1])
    return figure


def _scale(estimates: Sequence[Estimate], name: str) -> tuple[str, float]:
    """Label and factor of a quantity, by the values of most of the time."""
    usual = [np.percentile(e.outputs[name], SHOWN) for e in estimates if name in e.outputs]
    label, scale = suited(name.replace("_", " "), QUANTITIES[name], *usual)
    return label.replace(" / ", "\n/ "), scale  # longer than its panel is high


def _panel(axis: Any, record: Record, estimates: Sequence[Estimate], name: str, scale: float) -> None:
    """One quantity; smoothed values at the times that they belong to."""
    drawn = []
    for k, (estimate, color) in enumerate(zip(estimates, COLORS * len(estimates))):
        if name in estimate.outputs:
            drawn.append(scale * estimate.outputs[name])
            line(axis, record.times, drawn[-1], color, estimate.name, linewidth=THICKEST * 0.8**k)
        if f"smoothed_{name}" in estimate.outputs:
            published = estimate.outputs["smoothed_published"] > 0.5  # at the times that these belong to
            at, values = (estimate.outputs[f"smoothed_{signal}"][published] for signal in ("time", name))
            axis.plot(1e3 * at, scale * values, ".", color=color, markersize=2, label=f"{estimate.name}, smoothed")
    if name == "position" and record.position is not None:
        line(axis, record.times, scale * record.position, TRUE, "recorded", linestyle="--")
    low, high = np.percentile(np.concatenate(drawn), SHOWN)
    margin = 0.25 * (high - low) or abs(high) or 1.0
    axis.set_ylim(low - margin, high + margin)  # a transient at the start must not hide the rest
    legend(axis)
