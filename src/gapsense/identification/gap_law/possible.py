"""Inductances by gap, and whether any gap law of a device can explain them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gapsense.identification.gap_law.choice import FEWEST
from gapsense.identification.gap_law.laws import Vector
from gapsense.report.table import quantity

FLAT = 0.01  # relative change of the inductance over all gaps that tells no gap
USUAL = (("gap", "m", 1e-5, 0.2), ("inductance", "H", 1e-6, 50.0))  # of short strokes: beyond, the unit is a wrong one


class Inductances(NamedTuple):
    """Inductances at gaps that rise, at the lowest frequency, and at the others."""

    file: str
    gap: Vector  # [m]
    inductance: Vector  # [H]
    frequency: float | None  # [Hz]
    others: Mapping[float, Vector]  # inductance by frequency [H]


def impossible(found: Inductances) -> list[str]:
    """What no gap law can explain."""
    h, L, file = found.gap, found.inductance, found.file
    if np.unique(h).size < FEWEST:
        return [f"{file}: {np.unique(h).size} gaps found, at least {FEWEST} expected, better 8. Measure at more gaps."]
    told = []
    if h[0] < 0.0:
        told.append(
            f"{file}: a gap of {quantity(float(h[0]), 'm')} found; gaps are counted from 0, closed. Shift them."
        )
    if (L <= 0.0).any():
        told.append(f"{file}: an inductance of {quantity(float(L.min()), 'H')} found, positive ones expected.")
    told += [
        f"{file}: the largest {what} is {quantity(float(x.max()), unit)}, {quantity(least, unit)} to"
        f" {quantity(most, unit)} expected. Correct the unit in the head of the column."
        for (what, unit, least, most), x in zip(USUAL, (h, L))
        if not told and not least <= x.max() <= most
    ]
    return told or _eddy(found)


def _eddy(found: Inductances) -> list[str]:
    """Inductances that do not fall with the gap."""
    h, L = found.gap, found.inductance
    change = float(np.polyfit(h, L / L.mean(), 1)[0] * np.ptp(h))
    if change < -FLAT:
        return []
    at = "" if found.frequency is None else f" at {found.frequency:g} Hz, the lowest frequency of the table,"
    if change < FLAT:
        what = f"does not change by more than {100.0 * abs(change):.2g} % from the smallest to the largest gap"
    else:
        what = f"rises by {100.0 * change:.2g} % from the smallest to the largest gap, where it has to fall"
    return [
        f"{found.file}: the inductance{at} {what}: eddy currents keep the flux out of the iron. Measure at a lower"
        " frequency, 20 to 100 Hz, or with steps of the voltage, or check that the gap counts from 0, closed."
    ]
