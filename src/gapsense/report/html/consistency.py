"""Consistency of estimators: the stated bands compared with the actual errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.report.html.curves import SIGMAS, Curve, Panel
from gapsense.report.html.elements import Markup, table

WITHIN, SQUARE, WHITE = "within 2 std (95.4 %)", "mean square (1)", "correlation (white noise)"  # and what is expected
LIMIT = 1.96  # standard deviations, for 95 %
FEWEST = 20  # samples that say anything


class Consistency(NamedTuple):
    """An error or innovation in terms of the deviation that its estimator states."""

    name: str
    samples: int  # with a deviation above 0: at a stop, some filters know the position exactly
    inside: float  # share within the band
    square: float  # mean of the square, 1 where the deviation is right
    correlation: float  # of neighbours, 0 for white noise

    @property
    def limit(self) -> float:
        """Correlation below which white noise stays in 95 % of records."""
        return LIMIT / float(np.sqrt(self.samples))


def consistency(curve: Curve) -> Consistency | None:
    """How a curve lies in its band around zero; None without a band, or with hardly any samples."""
    if curve.band is None:
        return None
    deviation = curve.band / SIGMAS
    known = (deviation > 0.0) & np.isfinite(curve.values)
    if known.sum() < FEWEST:
        return None
    scaled = curve.values[known] / deviation[known]
    neighbours = float(np.sum(scaled[1:] * scaled[:-1]))
    total = float(np.sum(scaled**2))
    inside = float(np.mean(np.abs(scaled) <= SIGMAS))
    return Consistency(
        name=curve.name,
        samples=scaled.size,
        inside=inside,
        square=total / scaled.size,
        correlation=neighbours / total if total else float("nan"),
    )


def shown(panels: Sequence[Panel]) -> Markup:
    """A table of all errors and innovations that have bands."""
    found = [c for p in panels if p.is_error for c in map(consistency, p.curves) if c]
    rows = [(c.name, str(c.samples), f"{100 * c.inside:.1f} %", f"{c.square:.3g}", white(c)) for c in found]
    title = "Errors and innovations in terms of the stated deviation, and what is expected"
    return table(title, ("signal", "samples", WITHIN, SQUARE, WHITE), rows)


def white(found: Consistency) -> str:
    """Correlation of an innovation, which should be white; none for an error, where it says nothing."""
    if "innovation" not in found.name:
        return ""
    return f"{found.correlation:.3f} (within {found.limit:.3f})"
