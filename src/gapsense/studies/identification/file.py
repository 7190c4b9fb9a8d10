"""Parameter sets of the solenoid valve as files: read the known ones, write the identified ones.

The format is that of scenarios: a TOML file with a description, a source and `[values]` by the names of the FMU.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.files import write_atomically
from gapsense.studies.identification.fit import POOR, Identified
from gapsense.studies.identification.transfer import GAPS, parameters_of, read_values

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
    parameters, values = parameters_of("solenoid_valve", file), read_values([file] if file else [])
    law, table = str(values.get("gap.law", "linear")), values.get("gap.file")
    if law == "table" and table is None:
        raise ValueError(f"{file}, gap.file: missing; with `gap.law` = `table` a CSV file is expected. Add it.")
    return Known(parameters, law, Path(str(table)) if law == "table" else None)


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
