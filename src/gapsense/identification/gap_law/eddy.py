"""How far inductances at some frequencies are from the static one."""

from __future__ import annotations

import numpy as np

from gapsense.identification.gap_law.laws import Vector
from gapsense.identification.gap_law.possible import Inductances

NOTICED = 0.01


def missing_part(found: Inductances) -> Vector | None:
    """What eddy currents take of the static inductance at the lowest frequency, relative, at each gap.

    One loop of eddy currents leaves L / (1 + x) of the inductance at one frequency, L / (1 + r^2 x) at r times that;
    what the highest of three frequencies leaves does not pass through the iron.  None where no such loop explains them.
    """
    if not found.frequency or not found.others:
        return None
    rates = sorted(found.others)
    r, air = rates[0] / found.frequency, found.others[rates[-1]] if len(rates) > 1 else 0.0
    with np.errstate(all="ignore"):
        q = (found.inductance - air) / (found.others[rates[0]] - air)
        x = (q - 1.0) / (r**2 - q)
    return np.asarray(x / (1.0 + x) * (1.0 - air / found.inductance)) if np.all((q > 0.0) & (q < r**2)) else None


def remarks(found: Inductances) -> list[str]:
    """Sentences on the frequencies."""
    if found.frequency is None:
        return ["The table names no frequency: its inductances are taken for static ones."]
    lowest, told = f"{found.frequency:g} Hz", []
    wrong = [f"{rate:g} Hz" for rate, L in sorted(found.others.items()) if L[-1] >= L[0] * (1.0 - NOTICED)]
    if found.others:
        told.append(f"Only the lowest frequency, {lowest}, serves: eddy currents falsify the others more.")
    if wrong:
        told.append(f"At {', '.join(wrong)} the inductance does not even fall with the gap.")
    part = missing_part(found)
    if part is not None and part.max() > NOTICED:
        told.append(
            f"One loop of eddy currents that explains the two lowest frequencies takes {100.0 * part[0]:.2g} % of the"
            f" static inductance at {lowest} in the smallest gap, {100.0 * part[-1]:.2g} % in the largest. A lower"
            " frequency would be better; what was measured is used as it is."
        )
    return told
