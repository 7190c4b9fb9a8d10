"""Inductances at known gaps, as an instrument for coils gives them, at one frequency or at several.

Eddy currents keep the flux out of the iron as the frequency rises. The measured inductance is then smaller than the
static one, the more so the smaller the gap is, until it even rises with the gap.  So the lowest frequency serves.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense._os.files import SHOWN, Sheet, more, no_numbers, number, read_sheet
from gapsense.identification.gap_law.laws import FEWEST, Vector
from gapsense.problems import InputError, listing
from gapsense.report.table import quantity
from gapsense.units import factor

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
        f" {quantity(most, unit)} expected. Correct the unit in the header of the column."
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


HEAD = re.compile(r"(?P<name>.*?)(?:\s*[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])]|_(?P<after>[A-Za-z\u00b5\u03bc]+))?")
FREQUENCY = re.compile(r"(\d+(?:\.\d+)?)\s*(k|M)?Hz", re.IGNORECASE)
KILO = {"": 1.0, "k": 1e3, "m": 1e6}
POSITIONS = ("gap", "position", "stroke")  # names of the column that counts, best first
EXAMPLE = "`gap [mm]` and `inductance [mH]`, or `inductance 100Hz [mH]` for each frequency"


class Column(NamedTuple):
    """A column of the table."""

    place: int
    name: str
    scale: float  # of its unit
    frequency: float | None = None  # [Hz], where the head tells one


def read_inductances(path: Path, names: Mapping[str, str] | None = None) -> Inductances:
    """Inductances of a CSV file; an InputError tells all that is wrong with it.

    `names` has the columns that hold `gap` or `inductance`, where their heads do not tell.
    """
    problems: list[str] = []
    sheet = read_sheet(path, problems)
    if any(";" in name for name in sheet.names):
        problems = [f"{path.name}, row 1: the cells are separated by semicolons; commas are expected. Save it so."]
    positions, inductances = columns(sheet, "m", names or {}), columns(sheet, "H", names or {})
    sheet = without_notes(sheet, positions + inductances)
    problems = problems or [*missing(path.name, sheet, positions, inductances), *cells(sheet, positions + inductances)]
    if problems:
        raise InputError(problems)
    lowest, *others = sorted(inductances, key=lambda column: column.frequency or 0.0)
    gap = values(sheet, positions[0])
    order = np.argsort(gap, kind="stable")
    by_frequency = {each.frequency: values(sheet, each)[order] for each in others if each.frequency}
    found = Inductances(
        file=path.name,
        gap=gap[order],
        inductance=values(sheet, lowest)[order],
        frequency=lowest.frequency,
        others=by_frequency,
    )
    if wrong := impossible(found):
        raise InputError(wrong)
    return found


def columns(sheet: Sheet, unit: str, names: Mapping[str, str]) -> list[Column]:
    """Columns in a unit: of several gaps the one that is called so, of inductances all."""
    chosen = names.get("gap" if unit == "m" else "inductance")
    found = [made for k, _ in enumerate(sheet.names) if (made := column(sheet, k, unit))]
    if chosen is not None:
        return [each for each in found if chosen in (sheet.names[each.place], each.name)]
    if unit == "H":
        return found
    named = [each for name in POSITIONS for each in found if each.name.lower() == name]
    return named[:1] or found


def column(sheet: Sheet, place: int, unit: str) -> Column | None:
    """The column, if it is in that unit or a multiple: `gap [mm]`, `gap (mm)` or `gap_mm`."""
    match = HEAD.fullmatch(sheet.names[place])
    written = sheet.units[place] or (match and (match["unit"] or match["after"])) or ""
    scale = factor(written, unit)
    if match is None or scale is None:
        return None
    rate = FREQUENCY.search(match["name"])
    hertz = float(rate[1]) * KILO[(rate[2] or "").lower()] if rate else None
    return Column(place, match["name"], scale, hertz)


def missing(file: str, sheet: Sheet, positions: list[Column], inductances: list[Column]) -> list[str]:
    """What the heads leave open."""
    found, told = f"there are {listing(sheet.known) or 'no columns of numbers'}", []
    for what, unit, made in (("gap", "m", positions), ("inductance", "H", inductances)):
        if not made:
            told.append(f"{file}, row 1: no column of the {what} in {unit} is found; {found}. Name it as in {EXAMPLE}.")
    frequencies = [each.frequency for each in inductances]
    if len(positions) > 1:
        one = sheet.names[positions[0].place]
        told.append(f"{file}, row 1: {len(positions)} columns may be the gap. Choose one: `--column gap={one}`.")
    if len(inductances) > 1 and len(set(frequencies) - {None}) < len(inductances):
        told.append(
            f"{file}, row 1: {len(inductances)} columns of the inductance, whose names do not tell their frequencies."
            f" Write them as in {EXAMPLE}."
        )
    return told


def without_notes(sheet: Sheet, used: list[Column]) -> Sheet:
    """The sheet without rows in which all used cells are empty: notes beside the table."""
    kept = [k for k, row in enumerate(sheet.rows) if any(row[each.place].strip() for each in used)]
    return sheet._replace(rows=[sheet.rows[k] for k in kept], lines=[sheet.lines[k] for k in kept])


def cells(sheet: Sheet, used: list[Column]) -> list[str]:
    """Cells of the used columns that hold no number."""
    at = {each.place for each in used}
    cut = [[text if k in at else "0" for k, text in enumerate(row)] for row in sheet.rows]
    wrong = [(i, j) for i, row in enumerate(cut) for j, text in enumerate(row) if not np.isfinite(number(text) or 0.0)]
    told = [
        f"{sheet.place(i, j)}: `{cut[i][j]}` found, a finite number expected. Correct it." for i, j in wrong[:SHOWN]
    ]
    return no_numbers(sheet._replace(rows=cut)) + told + more(sheet.path, len(wrong), "cells are not finite")


def values(sheet: Sheet, used: Column) -> Vector:
    """Numbers of a column in SI units."""
    return used.scale * np.array([float(row[used.place]) for row in sheet.rows])


def columns_given(column: Sequence[str] | None) -> dict[str, str]:
    """Columns by quantity, from texts `QUANTITY=NAME`."""
    names = dict(text.partition("=")[::2] for text in column or [])
    if wrong := [name for name in names if name not in ("gap", "inductance")]:
        raise ValueError(f"--column: `{wrong[0]}` found, `gap=NAME` or `inductance=NAME` expected.")
    return names


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
