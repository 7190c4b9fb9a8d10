"""Figure 3 of [SEMERA] from a run of its scenario."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, Vector, legend, line, recorded, stack
from gapsense.studies.semera.observability import steps_since_observable

LABELS = [
    "voltage / V",
    "current / mA",
    "r / Ohm",
    "l / mH",
    "flux linkage\n/ mWb",
    "SNR u / dB",
    "SNR i / dB",
    "steps since\nobservable",
]

ESTIMATES = ("resistance", "inductance", "flux_linkage")
OTHERS = (
    "drive.voltage",
    "sensor.voltage_measured",
    "sensor.current_measured",
    "semera.quality",
    "offline.published",
    "offline.published_time",
)


def run_figure(result: Result) -> Figure:
    """Measurements, estimates against the truth, signal-to-noise ratios, and steps since the last observable state."""
    plant = plant_of(result)
    drawn, axes = stack(result.run.title, LABELS)
    rows = result.stepped("sensor.current_measured")
    t = result.times[rows]
    measurements(axes[0], axes[1], result, t, rows)
    estimates(axes[2:5], result, plant, t, rows)
    for axis, name, truth in (
        (axes[5], "sensor.voltage_measured", "drive.voltage"),
        (axes[6], "sensor.current_measured", f"{plant}.current"),
    ):
        measured = result[name][rows]
        axis.plot(1e3 * t, snr(measured, measured - result[truth][rows]), ".", color=FAINT, markersize=2)
    line(axes[7], t, steps_since_observable(result[f"{plant}.current"][rows], t[1] - t[0]), TRUE)
    axes[7].set_yscale("symlog", linthresh=10)
    return drawn


def plant_of(result: Result) -> str:
    """Name of the actuator; a ValueError names all signals that the figure needs and the scenario does not record."""
    plant = next((name.partition(".")[0] for name in result.signals if name.endswith(".position")), "<actuator>")
    estimates = [f"{e}.{s}" for e in ("semera", "integral", "offline") for s in ESTIMATES]
    truths = [f"{plant}.{signal}" for signal in ("position", "current", "inductance", "flux_linkage")]
    recorded(result, (*truths, *OTHERS, *estimates))
    return plant


def measurements(voltage: Any, current: Any, result: Result, t: Vector, rows: Any) -> None:
    """Measured voltage, and current split by the quality that SEMERA gives it."""
    line(voltage, t, result["sensor.voltage_measured"][rows], TRUE)
    i, high = 1e3 * result["sensor.current_measured"][rows], result["semera.quality"][rows] > 0.5
    current.plot(1e3 * t[high], i[high], ".", color=FIRST, markersize=2, label="high quality")
    current.plot(1e3 * t[~high], i[~high], ".", color=SECOND, markersize=2, label="low quality")
    legend(current)


def estimates(axes: Any, result: Result, plant: str, t: Vector, rows: Any) -> None:
    """Resistance, inductance and flux linkage: truth, SEMERA, integral, and offline integral at its own times."""
    resistance = np.full(t.size, float(result.parameters[f"{plant}.coil.resistance"]))
    truths = {
        "resistance": resistance,
        "inductance": result[f"{plant}.inductance"][rows],
        "flux_linkage": result[f"{plant}.flux_linkage"][rows],
    }
    factors = {"resistance": 1.0, "inductance": 1e3, "flux_linkage": 1e3}
    order = np.argsort(result["offline.published_time"][rows], kind="stable")
    order = order[result["offline.published"][rows][order] > 0.5]
    for axis, (name, truth) in zip(axes, truths.items()):
        line(
            axis,
            result["offline.published_time"][rows][order],
            factors[name] * result[f"offline.{name}"][rows][order],
            THIRD,
            "offline integral",
        )
        line(axis, t, factors[name] * result[f"integral.{name}"][rows], SECOND, "integral")
        line(axis, t, factors[name] * result[f"semera.{name}"][rows], FIRST, "SEMERA")
        line(axis, t, factors[name] * truth, TRUE, "true", linestyle="--")
    legend(axes[1])
    low, high = 1e3 * truths["inductance"].min(), 1e3 * truths["inductance"].max()
    axes[1].set_ylim(
        low - 0.5 * (high - low), high + 0.7 * (high - low)
    )  # the integral estimate leaves the paper's figure too


def snr(signal: Vector, noise: Vector) -> Vector:
    """20 log10 |signal / noise| [dB], as [SEMERA] defines it sample by sample."""
    tiny = np.finfo(float).tiny
    ratio: Vector = 20.0 * np.log10(np.maximum(np.abs(signal), tiny) / np.maximum(np.abs(noise), tiny))
    return np.clip(ratio, -20.0, 140.0)
