"""A soft-landing cycle in numbers: what each phase needs."""

from __future__ import annotations

import numpy as np

from gapsense.actuators.motion import CLOSED, MOVING
from gapsense.studies.soft_landing.phases import Cycle

COLUMNS = (  # heading, field, factor
    ("voltage / V", "voltage", 1.0),
    ("current / mA", "current", 1e3),
    ("flux / uWb", "flux", 1e6),
    ("core field / (A/m)", "core_field", 1.0),
)


def text(cycle: Cycle) -> str:
    """Range of voltage, current, flux and field in each phase."""
    lines = [f"{'phase':10} {'from / ms':>10} {'to / ms':>9}" + "".join(f"{name:>21}" for name, _, _ in COLUMNS)]
    for rows in np.split(np.arange(cycle.time.size), np.flatnonzero(np.diff(cycle.time) == 0.0) + 1):
        begin, end = 1e3 * cycle.time[rows[[0, -1]]]
        if end > begin:
            cells = [_range(factor * getattr(cycle, field)[rows]) for _, field, factor in COLUMNS]
            lines.append(f"{_phase(cycle, rows[0]):10} {begin:10.4g} {end:9.4g}" + "".join(f"{c:>21}" for c in cells))
    return "\n".join(lines)


def _phase(cycle: Cycle, row: int) -> str:
    mode = cycle.mode[row]
    return "moving" if mode == MOVING else "closed" if mode == CLOSED else "open"


def _range(values: np.typing.NDArray[np.float64]) -> str:
    low, high = values.min(), values.max()
    return f"{low:.4g}" if high - low < 1e-9 else f"{low:.4g} to {high:.4g}"
