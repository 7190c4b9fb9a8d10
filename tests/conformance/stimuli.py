"""Inputs that move a component, and other values for its parameters."""

from __future__ import annotations

import random
from typing import Any

from gapsense.fmi.ports import Component


def rows(component: Component, count: int, seed: int = 0) -> list[list[float]]:
    """Random inputs within their ranges, or plus and minus their nominal values; some are held for a while."""
    rng = random.Random(f"{component.name} {seed}")
    row = [float(port.start) for port in component.of("input")]
    found = []
    for _ in range(count):
        row = [drawn(port, rng) if rng.random() < 0.2 else old for port, old in zip(component.of("input"), row)]
        found.append(row)
    return found


def drawn(port: Any, rng: random.Random) -> float:
    """A value that the port takes."""
    low = -port.nominal if port.min is None else port.min
    return rng.uniform(low, port.nominal if port.max is None else port.max)


def tuned(component: Component) -> dict[int, float]:
    """Other values for all parameters that may be changed during a run, by value reference."""
    ports = [(k, p) for k, p in enumerate(component.ports) if p.variability == "tunable"]
    return {k: 1.0625 * p.start if p.max is None else min(1.0625 * p.start, p.max) for k, p in ports}
