"""A gap law as parameters of the solenoid valve: by formula where it has one, otherwise as a table beside the set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from gapsense._os.files import write_atomically, write_columns
from gapsense.actuators.magnetics import MU_0
from gapsense.identification.actuator.file import line
from gapsense.identification.assumptions import marks
from gapsense.identification.gap_law.laws import Law, rows
from gapsense.identification.transfer import GAPS, TABLE_UNITS
from gapsense.tables import Value


def fields(law: Law) -> dict[str, float]:
    """Fields of the valve's parameters that a law by formula has."""
    if law.name == "linear":
        return {"gap_slope": law.numbers[0]}
    if law.name == "fringing":
        r0, _, window = law.numbers
        return {"gap_area": 1.0 / (MU_0 * r0), "gap_window": 0.5 * window}
    return {}


def values(law: Law, turns: float) -> dict[str, Value]:
    """Parameters by name, but for the file of a table; all that is left without a gap is ascribed to the core."""
    numbers = {name.replace("_", "."): number for name, number in fields(law).items()}
    kind = law.name if numbers else "table"
    return {"coil.turns": turns, "core.reluctance": law.offset, "gap.law": kind, **numbers}


def write(
    file: Path,
    law: Law,
    turns: float,
    upper: float,
    given: Mapping[str, Value],
    origin: str,
    assumed: Sequence[str] = (),
) -> list[Path]:
    """Write a parameter set, what was given and the law in its place, and the table that it needs; the files."""
    found, table = values(law, turns), file.with_name(f"{file.stem}_law.csv")
    file.parent.mkdir(parents=True, exist_ok=True)
    if found["gap.law"] == "table":
        write_atomically(table, lambda out: write_columns(out, rows(law._replace(offset=0.0), upper), TABLE_UNITS))
        found["gap.file"] = str(table.resolve())
    laws = {name for names in GAPS.values() for name in names}
    kept = {name: value for name, value in given.items() if name not in laws}
    if "coil.turns" in assumed:  # the law rests on them
        assumed = [*assumed, *(name for name in found if name in laws)]
    lines = [
        'description = "Gap law from measured inductances"',
        f'source = "{origin}"',
        *marks([*dict.fromkeys(assumed)]),
        "",
        "[values]",
        *(line(name, value, file, None) for name, value in {**kept, **found}.items()),
    ]
    write_atomically(file, lambda out: out.writelines(f"{text}\n" for text in lines))
    return [file, *([table] if "gap.file" in found else [])]
