"""Section II-B of [SEMERA] in numbers: ranks for typical currents, and the count per sample along a run."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gapsense.cosim import Result
from gapsense.studies.semera.observability import (
    TOLERANCE,
    flux_state_matrix,
    observability_matrix,
    rank,
    steps_since_observable,
)

Vector = npt.NDArray[np.float64]
WINDOW = 4  # samples: three for the smallest window, and the one before


def typical_currents(dt: float, samples: int = 12) -> dict[str, Vector]:
    """Constant, linear, exponential and quadratic currents [A]."""
    t = dt * np.arange(samples)
    return {
        "constant": np.full(samples, 0.3),
        "linear (33)-(35)": 0.1 + 40.0 * t,
        "exponential": 0.4 * (1.0 - np.exp(-t / 1e-3)),
        "quadratic": 0.1 + 4e5 * t**2,
    }


def text(result: Result, tolerance: float = TOLERANCE) -> str:
    """Ranks (31)-(35) and (39), and the steps since the last observable state of a run of the SEMERA scenario."""
    signal = current_signal(result)
    rows = result.stepped("sensor.current_measured" if "sensor" in result.run.components else signal)
    t, current = result.times[rows], result[signal][rows]
    if t.size < WINDOW:
        raise ValueError(f"the run has {t.size} samples; the count needs at least {WINDOW}. Run it longer.")
    dt = float(t[1] - t[0])
    lines = [f"Ranks, with singular values above {tolerance:g} of the largest after scaling (full rank is 3)", ""]
    lines.append(f"{'current':20} {'inductance state (31)':>22} {'12 samples':>11} {'flux state (39)':>16}")
    for name, i in typical_currents(dt).items():
        ranks = (observability_matrix(i, dt), observability_matrix(i, dt, i.size - 2), flux_state_matrix(i, dt))
        shown = [int(rank(matrices, dt, tolerance).max()) for matrices in ranks]
        lines.append(f"{name:20} {shown[0]:22d} {shown[1]:11d} {shown[2]:16d}")
    return "\n".join([*lines, "", *along(t, current, dt, tolerance)])


def along(t: Vector, current: Vector, dt: float, tolerance: float) -> list[str]:
    """Lines on the count per sample along a run."""
    steps = steps_since_observable(current, dt, tolerance)
    finite = np.isfinite(steps)
    lines = [f"Steps since the last observable state, true current of the run, {t.size} samples of {dt * 1e6:g} us"]
    for label, mask in (
        ("2 (the minimum)", steps == 2),
        ("3 to 10", (steps > 2) & (steps <= 10)),
        ("more than 10", finite & (steps > 10)),
    ):
        lines.append(f"  {label:18} {100 * mask.mean():5.1f} % of the samples")
    lines.append(f"  {'none so far':18} {100 * (~finite).mean():5.1f} %")
    if not finite.any():
        return lines
    worst = int(np.argmax(np.where(finite, steps, -1.0)))
    return [*lines, f"  longest: {steps[worst]:.0f} steps, at t = {1e3 * t[worst]:.3f} ms"]


def current_signal(result: Result) -> str:
    """Name of the recorded true current."""
    names = [n for n in result.signals if n.endswith(".current")]
    if not names:
        raise ValueError("the scenario records no `current` of an actuator. Add it to `[record]`.")
    return names[0]
