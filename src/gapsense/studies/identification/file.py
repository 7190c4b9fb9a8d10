"""Parameter sets of the solenoid valve as files: read the known ones, write the identified ones.

The format is that of scenarios: a TOML file with a description, a source and `[values]` by the names of the FMU.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense.actuators.parameters import VALVE
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.files import read_columns, write_atomically
from gapsense.parameters import read_parameters
from gapsense.problems import ScenarioError, suggest
from gapsense.studies.identification.fit import POOR, Identified
from gapsense.studies.identification.transfer import GAPS
from gapsense.tables import Value, found, is_number

COLUMNS = ("gap", "reluctance", "slope")
WRITTEN = (
    "coil.resistance",
    "coil.turns",
    "core.reluctance",
    "core.saturation",
    "mover.mass",
    "spring.stiffness",
    "spring.rest",
    "damping",
    "stop.lower",
    "stop.upper",
    "initial.position",
)
NUMBERS = (*WRITTEN, *GAPS["linear"], *GAPS["fringing"], "micro_step")
MAY_BE_ZERO = ("gap.slope", "damping", "stop.lower", "initial.position")


class Known(NamedTuple):
    """Known parameters and first guesses; `table` is the file of the gap table, where the law needs one."""

    parameters: Parameters
    law: str = "linear"
    table: Path | None = None


def field(name: str) -> str:
    """Name in the records of the kernel."""
    return name.replace(".", "_")


def read_known(file: Path | None) -> Known:
    """Known parameters and first guesses from a parameter-set file; what it leaves out is as in [SEMERA] Table I."""
    if file is None:
        return Known(VALVE)
    problems: list[str] = []
    values = read_parameters(file, problems)
    law = str(values.get("gap.law", "linear"))
    problems += [f"{file.name}, {name}: {p}" for name, value in values.items() if (p := _problem(name, value))]
    if law == "table" and "gap.file" not in values:
        problems.append(f"{file.name}, gap.file: missing; with `gap.law` = `table` a CSV file is expected. Add it.")
    if problems:
        raise ScenarioError(problems)
    par = VALVE._replace(**{field(n): float(v) for n, v in values.items() if n in NUMBERS})
    par = par._replace(gap_law=float(list(GAPS).index(law)))
    if law != "table":
        return Known(par, law)
    table = Path(str(values["gap.file"]))
    gap, reluctance, slope = _gap_table(table)
    return Known(par._replace(gap_file_gap=gap, gap_file_reluctance=reluctance, gap_file_slope=slope), law, table)


def _problem(name: str, value: Value) -> str:
    """What is wrong with a value, or nothing."""
    if name == "gap.law":
        return "" if value in GAPS else f"{found(value)} found. {suggest(str(value), GAPS)}"
    if name == "gap.file":
        return ""
    if name not in NUMBERS:
        return f"unknown parameter. {suggest(name, (*NUMBERS, 'gap.law', 'gap.file'))}"
    is_good = is_number(value) and (float(value) > 0.0 or (name in MAY_BE_ZERO and float(value) == 0.0))
    return "" if is_good else f"{found(value)} found, a positive number is expected. Correct the value."


def _gap_table(file: Path) -> tuple[list[float], ...]:
    columns = read_columns(file)
    missing = [c for c in COLUMNS if c not in columns]
    if missing:
        raise ScenarioError([f"{file.name}: column `{missing[0]}` is missing; {', '.join(COLUMNS)} are expected."])
    return tuple(columns[c].tolist() for c in COLUMNS)


def write_identified(file: Path, result: Identified, known: Known, sources: Sequence[Path]) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`."""
    errors = {name: error for name, error in zip(result.names, result.uncertainty.relative)}
    lines = [
        'description = "Solenoid valve, identified"',
        f'source = "gapsense identify {" ".join(source.name for source in sources)}"',
        "",
        "[values]",
    ]
    for name in WRITTEN:
        error = errors.get(field(name))
        note = "" if error is None else f"  # +- {100.0 * error:.2g} %" + ("" if error < POOR else ", not identified")
        lines.append(f"{_key(name)} = {float(getattr(result.parameters, field(name)))!r}{note}")
    lines.append(f'"gap.law" = "{known.law}"')
    for name in GAPS[known.law]:
        if known.table is not None:
            relative = Path(os.path.relpath(known.table.resolve(), file.resolve().parent)).as_posix()
            lines.append(f'"{name}" = "{relative}"')
        else:
            lines.append(f"{_key(name)} = {float(getattr(result.parameters, field(name)))!r}")
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: out.writelines(f"{line}\n" for line in lines))
    return file


def _key(name: str) -> str:
    return f'"{name}"' if "." in name else name
