"""What a benchmark is to stay below: a bound that is missed is a line of output, which `all.py` collects."""

from __future__ import annotations

MISSED = "Missed:"  # begins such a line


def hold(what: str, value: float, bound: float, unit: str) -> None:
    """Say so if a value is not below its bound."""
    if not value < bound:
        print(f"{MISSED} {what}: {value:.3g} {unit}, bound {bound:g} {unit}", flush=True)
