"""Parameter sets of the solenoid valve as files: read the known ones, write the identified ones.

The format is that of scenarios: a TOML file with a description, a source and `[values]` by the names of the FMU.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense._os.files import write_atomically, write_columns
from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Port
from gapsense.fmi.values import ValuesError, fields
from gapsense.identification.assumptions import marks, stated
from gapsense.identification.transfer import GAPS, TABLE_UNITS, parameters_of, read_sets
from gapsense.identification.valve import lossy_valve
from gapsense.identification.valve.device import value
from gapsense.identification.valve.form import TABLE
from gapsense.identification.valve.forms import LOSSES
from gapsense.identification.valve.identified import Identified
from gapsense.identification.valve.scales import similar
from gapsense.problems import InputError
from gapsense.tables import Value

PORTS = {port.field: port for port in load_component(own("solenoid_valve")).of("parameter")}
PORTS |= {port.field: port for port in load_component(own("ekf")).of("parameter") if port.field in LOSSES}
PORTS[TABLE[0]] = Port("gap.file", "parameter", "1", "Factor on the table of the gap law")
BY_NAME = {port.name: port for port in PORTS.values()}


class Known(NamedTuple):
    """Known parameters and first guesses; `table` is the file of the gap table, where the law needs one."""

    parameters: Parameters
    table: Path | None = None
    losses: Mapping[str, float] = {}
    resistance: float | None = None  # of the coil, where the file has it [Ohm]
    given: frozenset[str] = frozenset()  # fields whose values are known, or were guessed by the user


def read_known(file: Path | None) -> Known:
    """Known parameters and first guesses from a parameter-set file.

    What it leaves out is that of a valve that is electrically like the one of [SEMERA] Table I.
    """
    values, assumed = read_sets([file] if file else [])
    law, table = str(values.get("gap.law", "linear")), values.get("gap.file")
    if law == "table" and table is None:
        raise ValueError(f"{file}, gap.file: missing; with `gap.law` = `table` a CSV file is expected. Add it.")
    defaults: dict[str, Value] = {}
    if isinstance(lower := values.get("stop.lower"), float):
        defaults = {"stop.upper": lower + PORTS["stop_upper"].start}
    fields_of = {port.name: field for field, port in PORTS.items()}
    there, known = ({fields_of[n] for n in names if n in fields_of} for names in (values, {*values} - {*assumed}))
    return Known(
        parameters=similar(parameters_of("solenoid_valve", file, defaults), there),
        table=Path(str(table)) if law == "table" else None,
        losses=_losses(values, file),
        resistance=_R(values),
        given=frozenset(known),
    )


def _R(values: Mapping[str, Value]) -> float | None:
    return float(values["coil.resistance"]) if "coil.resistance" in values else None


def _losses(values: Mapping[str, Value], file: Path | None) -> dict[str, float]:
    """Losses of the core that a set has, as estimators take them."""
    given = {PORTS[name].name: values[PORTS[name].name] for name in LOSSES if PORTS[name].name in values}
    try:
        found = fields(load_component(own("ekf")), given, own("ekf"))
    except ValuesError as error:
        raise InputError([f"{file and file.name}: {problem}" for problem in error.problems]) from None
    return {name: float(found[name]) for name in LOSSES if PORTS[name].name in given}


def write_identified(
    file: Path,
    result: Identified,
    known: Known,
    sources: Sequence[Path],
    noises: Mapping[str, float],
    notes: Sequence[str] = (),
) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`, with notes as comments."""
    names = [name for name in PORTS if not name.startswith(("gap", "micro_step")) and name not in LOSSES]
    lines = [
        'description = "Solenoid valve, identified"',
        f'source = "gapsense identify {" ".join(source.name for source in sources)}"',
        *marks([PORTS[name].name for name in result.assumed]),
        *(f"# {note}" for note in notes),
        "",
        "[values]",
        *(_line(name, result) for name in [*names, *_lost(result)]),
        *_gap(file, result, known),
        *(f'"{name}" = {value!r}  # of the records, for estimators' for name, value in noises.items()),
    ]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: out.writelines(f"{line}\n" for line in lines))
    return file


def _lost(result: Identified) -> list[str]:
    """Parameters of the losses that the device has."""
    if not isinstance(result.parameters, lossy_valve.Parameters):
        return []
    par = result.parameters
    return [*LOSSES[:1] * (par.core_eddy > 0.0), *LOSSES[1:] * (par.core_hysteresis > 0.0)]


def _gap(file: Path, result: Identified, known: Known) -> list[str]:
    """The gap law; a table that was multiplied by a factor is written beside the file."""
    law, table = GapLaw(value(result.parameters, "gap_law")).name, known.table
    if table is None:
        return [
            f'"gap.law" = "{law}"',
            *(_line(name, result) for name, port in PORTS.items() if port.name in GAPS[law]),
        ]
    if TABLE[0] in result.form.fitted:
        table = file.with_name(f"{file.stem}-gap.csv")
        columns = {name: np.array(value(result.parameters, f"gap_file_{name}")) for name in TABLE_UNITS}
        table.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(table, lambda text: write_columns(text, columns, TABLE_UNITS))
    relative = Path(os.path.relpath(table.resolve(), file.resolve().parent)).as_posix()
    return ['"gap.law" = "table"', f'"gap.file" = "{relative}"']


def found(result: Identified, name: str) -> float:
    """Value of a parameter; of the table of a gap law, the factor on it."""
    if name != TABLE[0]:
        return float(value(result.parameters, name))
    now, before = (value(par, name) for par in (result.parameters, result.form.known))
    return float(now[-1] / before[-1])


def _line(name: str, result: Identified) -> str:
    """A parameter, with its standard error if it was fitted."""
    port, error = PORTS[name], dict(zip(result.names, result.uncertainty.relative)).get(name)
    note = (
        "" if error is None else f"  # +- {100.0 * error:.2g} %" + (", not identified" if name in result.poor else "")
    )
    if name in result.assumed:
        note = f"  # assumed, not known: {stated(port.name, result.assumed[name])}"
    note = "  # not identified, held" if name in result.held else note
    key = f'"{port.name}"' if "." in port.name else port.name
    return f"{key} = {found(result, name)!r}{note}"
