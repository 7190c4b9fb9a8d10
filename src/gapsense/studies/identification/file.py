"""Parameter sets of the solenoid valve as files: read the known ones, write the identified ones.

The format is that of scenarios: a TOML file with a description, a source and `[values]` by the names of the FMU.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.files import write_atomically
from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Port
from gapsense.studies.identification.device import value
from gapsense.studies.identification.fit import POOR, Identified
from gapsense.studies.identification.transfer import GAPS, parameters_of, read_values

PORTS = {port.field: port for port in load_component(own("solenoid_valve")).of("parameter")}


class Known(NamedTuple):
    """Known parameters and first guesses; `table` is the file of the gap table, where the law needs one."""

    parameters: Parameters
    law: str = "linear"
    table: Path | None = None


def read_known(file: Path | None) -> Known:
    """Known parameters and first guesses from a parameter-set file; what it leaves out is as in [SEMERA] Table I."""
    parameters, values = parameters_of("solenoid_valve", file), read_values([file] if file else [])
    law, table = str(values.get("gap.law", "linear")), values.get("gap.file")
    if law == "table" and table is None:
        raise ValueError(f"{file}, gap.file: missing; with `gap.law` = `table` a CSV file is expected. Add it.")
    return Known(parameters, law, Path(str(table)) if law == "table" else None)


def write_identified(
    file: Path,
    result: Identified,
    known: Known,
    sources: Sequence[Path],
    noises: Mapping[str, float],
    notes: Sequence[str] = (),
) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`, with notes as comments."""
    lines = [
        'description = "Solenoid valve, identified"',
        f'source = "gapsense identify {" ".join(source.name for source in sources)}"',
        *(f"# {note}" for note in notes),
        "",
        "[values]",
        *(_line(port, result) for port in PORTS.values() if port.name.partition(".")[0] not in ("gap", "micro_step")),
        f'"gap.law" = "{known.law}"',
    ]
    if known.table is not None:
        relative = Path(os.path.relpath(known.table.resolve(), file.resolve().parent)).as_posix()
        lines.append(f'"gap.file" = "{relative}"')
    else:
        lines += [_line(port, result) for port in PORTS.values() if port.name in GAPS[known.law]]
    lines += [f'"{name}" = {value!r}  # of the records, for estimators' for name, value in noises.items()]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: out.writelines(f"{line}\n" for line in lines))
    return file


def _line(port: Port, result: Identified) -> str:
    """A parameter, with its standard error if it was fitted."""
    error = dict(zip(result.names, result.uncertainty.relative)).get(port.field)
    note = "" if error is None else f"  # +- {100.0 * error:.2g} %" + ("" if error < POOR else ", not identified")
    key = f'"{port.name}"' if "." in port.name else port.name
    return f"{key} = {float(value(result.parameters, port.field))!r}{note}"
