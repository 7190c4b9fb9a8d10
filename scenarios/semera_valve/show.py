"""Figure 3 of [SEMERA] from a run of its scenario, and its Section II-B in numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.cosim import Result
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, Vector, legend, line, require_recorded, stack
from gapsense.report.table import table

from .observability import TOLERANCE, flux_state_matrix, observability_matrix, rank, steps_since_observable

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
FACTORS = {"resistance": 1.0, "inductance": 1e3, "flux_linkage": 1e3}  # of what is estimated, for display
OTHERS = (
    "drive.voltage",
    "sensor.voltage_measured",
    "sensor.current_measured",
    "semera.quality",
    "offline.published",
    "offline.published_time",
)
FEWEST = 4  # samples: three for the smallest window, and the one before


def run_figure(result: Result) -> Figure:
    """Measurements, estimates against the truth, signal-to-noise ratios, and steps since the last observable state."""
    plant = plant_of(result)
    figure, axes = stack(result.run.title, LABELS)
    rows = result.stepped("sensor.current_measured")
    t, current = result.times[rows], result[f"{plant}.current"][rows]
    measurements(axes[0], axes[1], result, t, rows)
    resistance = np.full(t.size, float(result.parameters[f"{plant}.coil.resistance"]))
    inductance, flux_linkage = result[f"{plant}.inductance"][rows], result[f"{plant}.flux_linkage"][rows]
    for axis, name, truth in zip(axes[2:5], FACTORS, (resistance, inductance, flux_linkage)):
        estimates(axis, result, rows, name, truth)
    legend(axes[3])
    low, span = 1e3 * inductance.min(), 1e3 * np.ptp(inductance)
    axes[3].set_ylim(low - 0.5 * span, low + 1.7 * span)  # the integral estimate leaves the paper's figure too
    for axis, name, truth in zip(axes[5:7], ("voltage", "current"), (result["drive.voltage"][rows], current)):
        measured = result[f"sensor.{name}_measured"][rows]
        axis.plot(1e3 * t, snr(measured, measured - truth), ".", color=FAINT, markersize=2)
    line(axes[7], t, steps_since_observable(current, t[1] - t[0]), TRUE)
    axes[7].set_yscale("symlog", linthresh=10)
    return figure


def plant_of(result: Result) -> str:
    """Name of the actuator; a ValueError names all signals that the figure needs and the scenario does not record."""
    plant = next((name.partition(".")[0] for name in result.signals if name.endswith(".position")), "<actuator>")
    estimated = [f"{e}.{s}" for e in ("semera", "integral", "offline") for s in FACTORS]
    truths = [f"{plant}.{signal}" for signal in ("position", "current", "inductance", "flux_linkage")]
    require_recorded(result, (*truths, *OTHERS, *estimated))
    return plant


def measurements(voltage: Any, current: Any, result: Result, t: Vector, rows: Any) -> None:
    """Measured voltage, and current split by the quality that SEMERA gives it."""
    line(voltage, t, result["sensor.voltage_measured"][rows], TRUE)
    i, high = 1e3 * result["sensor.current_measured"][rows], result["semera.quality"][rows] > 0.5
    current.plot(1e3 * t[high], i[high], ".", color=FIRST, markersize=2, label="high quality")
    current.plot(1e3 * t[~high], i[~high], ".", color=SECOND, markersize=2, label="low quality")
    legend(current)


def estimates(axis: Any, result: Result, rows: Any, name: str, truth: Vector) -> None:
    """Truth, SEMERA and integral of one quantity at the samples, and offline integral at its own times."""
    published = np.flatnonzero(rows & (result["offline.published"] > 0.5))
    published = published[np.argsort(result["offline.published_time"][published], kind="stable")]
    own_times, offline = result["offline.published_time"][published], result[f"offline.{name}"][published]
    t, factor = result.times[rows], FACTORS[name]
    line(axis, own_times, factor * offline, THIRD, "offline integral")
    line(axis, t, factor * result[f"integral.{name}"][rows], SECOND, "integral")
    line(axis, t, factor * result[f"semera.{name}"][rows], FIRST, "SEMERA")
    line(axis, t, factor * truth, TRUE, "true", linestyle="--")


def snr(signal: Vector, noise: Vector) -> Vector:
    """20 log10 |signal / noise| [dB], as [SEMERA] defines it sample by sample."""
    tiny = np.finfo(float).tiny
    ratio: Vector = 20.0 * np.log10(np.maximum(np.abs(signal), tiny) / np.maximum(np.abs(noise), tiny))
    return np.clip(ratio, -20.0, 140.0)


def run_tables(result: Result) -> list[Table | str]:
    """Ranks (31)-(35) and (39), and the steps since the last observable state of a run of the SEMERA scenario."""
    signal = next((name for name in result.signals if name.endswith(".current")), None)
    if signal is None:
        raise ValueError("the scenario records no `current` of an actuator. Add it to `[record]`.")
    rows = result.stepped("sensor.current_measured" if "sensor" in result.run.components else signal)
    t = result.times[rows]
    if t.size < FEWEST:
        raise ValueError(f"the run has {t.size} samples; the count needs at least {FEWEST}. Run it longer.")
    dt = float(t[1] - t[0])
    return [ranks(dt), *counts(t, steps_since_observable(result[signal][rows], dt), dt)]


def ranks(dt: float, samples: int = 12) -> Table:
    """Largest ranks for constant, linear, exponential and quadratic currents."""
    t = dt * np.arange(samples)
    currents = {  # [A]
        "constant": np.full(samples, 0.3),
        "linear (33)-(35)": 0.1 + 40.0 * t,
        "exponential": 0.4 * (1.0 - np.exp(-t / 1e-3)),
        "quadratic": 0.1 + 4e5 * t**2,
    }
    rows = []
    for name, i in currents.items():
        matrices = (observability_matrix(i, dt), observability_matrix(i, dt, samples - 2), flux_state_matrix(i, dt))
        rows.append([name, *(str(rank(m, dt).max()) for m in matrices)])
    title = f"Ranks, with singular values above {TOLERANCE:g} of the largest after scaling (full rank is 3)"
    return table(title, ("current", "inductance state (31)", f"{samples} samples", "flux state (39)"), rows)


def counts(t: Vector, steps: Vector, dt: float) -> list[Table | str]:
    """How many of the samples have their last observable state how many steps ago, and the longest time without."""
    masks = {
        "2 (the minimum)": steps == 2,
        "3 to 10": (steps > 2) & (steps <= 10),
        "more than 10": steps > 10,
        "none so far": np.isnan(steps),
    }
    title = f"Steps since the last observable state, true current of the run, {t.size} samples of {dt * 1e6:g} us"
    shares = table(title, ("steps", "samples"), ((name, f"{100 * m.mean():.1f} %") for name, m in masks.items()))
    if np.isnan(steps).all():
        return [shares]
    worst = int(np.nanargmax(steps))
    return [shares, f"longest: {steps[worst]:.0f} steps, at t = {1e3 * t[worst]:.3f} ms"]
