"""A gap law as parameters of the solenoid valve: by formula where it has one, otherwise as a table beside the set."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gapsense.actuators.magnetics import MU_0
from gapsense.files import write_atomically, write_columns
from gapsense.studies.commissioning.file import line
from gapsense.studies.gap_law.laws import Law, Vector, reluctance
from gapsense.studies.identification.transfer import BEYOND, GAPS, ROWS, TABLE_UNITS
from gapsense.tables import Value


def rows(law: Law, upper: float) -> dict[str, Vector]:
    """Gap, reluctance and slope from no gap to beyond the largest one."""
    h = np.linspace(0.0, BEYOND * upper, ROWS)
    R, slope = reluctance(law, h)
    return {"gap": h, "reluctance": R, "slope": slope}


def values(law: Law, turns: float) -> dict[str, Value]:
    """Parameters by name, but for the file of a table; all that is left without a gap is ascribed to the core."""
    made: dict[str, Value] = {"coil.turns": turns, "core.reluctance": law.offset}
    if law.name == "linear":
        return {**made, "gap.law": "linear", "gap.slope": law.numbers[0]}
    if law.name == "fringing":
        r0, _, window = law.numbers
        return {**made, "gap.law": "fringing", "gap.area": 1.0 / (MU_0 * r0), "gap.window": 0.5 * window}
    return {**made, "gap.law": "table"}


def write(file: Path, law: Law, turns: float, upper: float, given: Mapping[str, Value], origin: str) -> list[Path]:
    """Write a parameter set, what was given and the law in its place, and the table that it needs; the files."""
    found, table = values(law, turns), file.with_name(f"{file.stem}_law.csv")
    file.parent.mkdir(parents=True, exist_ok=True)
    if found["gap.law"] == "table":
        write_atomically(table, lambda out: write_columns(out, rows(law, upper), TABLE_UNITS))
        found["gap.file"] = str(table.resolve())
    laws = {name for names in GAPS.values() for name in names}
    kept = {name: value for name, value in given.items() if name not in laws}
    lines = [
        'description = "Gap law from measured inductances"',
        f'source = "{origin}"',
        "",
        "[values]",
        *(line(name, value, file, None) for name, value in {**kept, **found}.items()),
    ]
    write_atomically(file, lambda out: out.writelines(f"{text}\n" for text in lines))
    return [file, *([table] if "gap.file" in found else [])]
