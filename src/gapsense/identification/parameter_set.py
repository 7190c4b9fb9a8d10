"""What a component takes of a parameter set that was made for the solenoid valve.

Most names mean the same everywhere.  But the models of [RTS] have a gap law of their own, with the parameter
`gap.fringing`: R_g = R_g0 + R_g0' z / (1 + k_f z ln(c_f/z)). That of [UKF] takes a table, and estimators of the
resistance start from priors.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapsense._os.files import read_columns, write_atomically, write_columns
from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.fmi.components import find_components, kernel_parameters, load_component, own
from gapsense.fmi.values import ValuesError, fields, unknown_parameter
from gapsense.identification.assumptions import marks
from gapsense.parameters import ParameterSet, is_file, read_set
from gapsense.problems import InputError
from gapsense.report.table import percent
from gapsense.tables import Value

# Parameters of each law of the valve.
GAPS = {"linear": ("gap.slope",), "fringing": ("gap.area", "gap.window"), "table": ("gap.file",)}
ROWS, BEYOND = 61, 1.2  # of a table made from a law, and how far it goes, in upper stops
TABLE_UNITS = {"gap": "m", "reluctance": "1/H", "slope": "1/(H.m)"}
SLOPES = ("gap.reluctance", "gap.slope")  # of a law by formula
AMBIGUOUS = ("gap.law", "gap.slope", "gap.window", "gap.file")  # of the valve and of [RTS]; not always the same


DIGITS = 8  # of what was found: more mean nothing


class Entry(NamedTuple):
    """A value in a parameter set, with what is to be said of it."""

    name: str
    value: Value
    note: str = ""


def write_set(
    file: Path,
    description: str,
    source: str,
    entries: Iterable[Entry],
    *,
    assumed: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`, with notes as comments."""
    lines = [
        f"description = {json.dumps(description)}",
        f"source = {json.dumps(source)}",
        *marks(assumed),
        *(f"# {note}" for note in notes),
        "",
        "[values]",
        *(_line(entry, file) for entry in entries),
    ]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: out.writelines(f"{line}\n" for line in lines))
    return file


def _line(entry: Entry, file: Path) -> str:
    name, value, note = entry
    if is_file(name, value):
        value = Path(os.path.relpath(Path(str(value)).resolve(), file.resolve().parent)).as_posix()
    return f"{json.dumps(name)} = {json.dumps(value)}" + (f"  # {note}" if note else "")


def round_value(value: Value) -> Value:
    """Round a number to as many digits as mean something; all else stays as it is."""
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def error_note(error: float | None, is_poor: bool = False) -> str:
    """What is said of a value with a standard error."""
    return "" if error is None else f"+- {format_error(error)}" + ", not identified" * is_poor


def format_error(error: float) -> str:
    """Write a relative standard error; at a limit of a search, and without any effect, there is none."""
    return percent(error) if math.isfinite(error) else "unknown"


def write_table(file: Path, columns: Mapping[str, NDArray[np.float64]]) -> Path:
    """Write a gap law as a table."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: write_columns(out, columns, TABLE_UNITS))
    return file


def read_values(files: Sequence[Path]) -> dict[str, Value]:
    """Values of parameter-set files; what a later file says wins.  An InputError tells all that is wrong."""
    return read_sets(files).values


def read_sets(files: Sequence[Path]) -> ParameterSet:
    """The same, with the names of the values that are assumed."""
    problems: list[str] = []
    values: dict[str, Value] = {}
    assumed: dict[str, None] = {}  # an ordered set
    for file in files:
        found = read_set(file, problems)
        values |= found.values
        assumed = {n: None for n in assumed if n not in found.values} | dict.fromkeys(found.assumed)
    if problems:
        raise InputError(problems)
    return ParameterSet(values, tuple(assumed))


def take_values(
    folders: Sequence[Path], files: Sequence[Path], known: Sequence[Path] = ()
) -> dict[Path, dict[str, Value]]:
    """What the components of some folders take of parameter sets, which describe a device.

    Each takes the parameters that it has.  A name that none of them has, nor those in the folders `known`, is refused
    together with all values that a component does not take.
    """
    values = read_values(files)
    components = {folder: load_component(folder) for folder in dict.fromkeys((*folders, *known))}
    names = {port.name for component in components.values() for port in component.of("parameter")}
    where = ", ".join(file.name for file in files)
    problems = [f"{where}: {unknown_parameter(name, names)}" for name in values if name not in names]
    made: dict[Path, dict[str, Value]] = {}
    for folder in folders:
        made[folder] = values_for([port.name for port in components[folder].of("parameter")], values)
        try:
            fields(components[folder], made[folder], folder)
        except ValuesError as error:
            problems += [f"{where}, {components[folder].name}: {problem}" for problem in error.problems]
    if problems:
        raise InputError(problems)
    return made


def parameters_of(name: str, file: Path | None, defaults: Mapping[str, Value] | None = None) -> Any:
    """Parameters of the kernel of the component in folder `name`: its own, or those of a parameter set."""
    folder = own(name)
    try:
        values = without_others(folder, read_values([file])) if file else {}
        return kernel_parameters(folder, {**(defaults or {}), **values})
    except ValuesError as error:
        raise InputError([f"{file.name if file else name}: {problem}" for problem in error.problems]) from None


def without_others(folder: Path, values: Mapping[str, Value]) -> dict[str, Value]:
    """Values of a set less those that only other components beside `folder` have, such as the noise of estimators.

    A gap law that the component has not stays, to be refused: without it another one would be taken.
    """
    mine = parameter_names([folder])
    if set(values) <= mine:
        return dict(values)
    others = parameter_names(find_components(folder.parent)) - mine
    return {name: v for name, v in values.items() if name not in others or name.startswith("gap.")}


def parameter_names(folders: Iterable[Path]) -> set[str]:
    """Names of the parameters of the components in some folders."""
    return {port.name for folder in folders for port in load_component(folder).of("parameter")}


def values_for(names: Collection[str], values: Mapping[str, Value]) -> dict[str, Value]:
    """Values for a component with the parameters `names`; what else `values` has is left out."""
    if "gap.factor" not in names:
        values = without_factor(values)
    expects = "prior.inductance" in names  # for others `prior.resistance` is how uncertain it is
    given = {name: value for name, value in values.items() if not (expects and is_deviation(name, values))}
    known = {**start(values), **(priors(values) if expects else {}), **given}
    if values.get("gap.law") in GAPS and ("gap.fringing" in values) != ("gap.fringing" in names):
        others = {name: value for name, value in known.items() if name not in AMBIGUOUS}
        known = others if "gap.fringing" in values else {**reduced_gap(values), **others}
    if values.get("gap.law") in GAPS and "gap.file" in names and "gap.law" not in names:
        known["gap.file"] = str(table_of(values if "gap.fringing" in values else {**values, **reduced_gap(values)}))
    return {name: value for name, value in known.items() if name in names}


def is_deviation(name: str, values: Mapping[str, Value]) -> bool:
    """Whether `prior.resistance` is an uncertainty, as in a set for `Mhe`, which has such priors for everything."""
    return name == "prior.resistance" and "prior.eddy" in values


def without_factor(values: Mapping[str, Value]) -> dict[str, Value]:
    """The same device without a factor of the gap reluctance, which only `Mhe` has."""
    factor, rest = float(values.get("gap.factor", 1.0)), {**values}
    rest.pop("gap.factor", None)
    if factor == 1.0 or "gap.law" not in values:
        return rest
    if values["gap.law"] == "table":
        columns = dict(read_columns(Path(str(values["gap.file"])), TABLE_UNITS))
        more: dict[str, NDArray[np.float64]] = {
            name: factor * columns[name] for name in ("reluctance", "slope") if name in columns
        }
        return {**rest, "gap.file": str(table_file({**columns, **more}))}
    return {**rest, **{name: factor * float(values[name]) for name in SLOPES if name in values}}


def table_of(values: Mapping[str, Value]) -> Path:
    """A gap law in the form of [RTS], as a file with gap, reluctance and slope from no gap to beyond the upper stop."""
    if values["gap.law"] == "table":
        return Path(str(values["gap.file"]))
    gaps = np.linspace(0.0, BEYOND * float(values["stop.upper"]), ROWS)
    k, window = float(values["gap.fringing"]), float(values.get("gap.window", 1.0))
    laws = [fringing(h, float(values["gap.slope"]), k, window)[:2] for h in gaps.tolist()]
    R, slope = np.array(laws).T
    return table_file({"gap": gaps, "reluctance": R + float(values["gap.reluctance"]), "slope": slope})


def table_file(columns: Mapping[str, NDArray[np.float64]]) -> Path:
    """A file with a gap law, in the folder for temporary files, under a name that its numbers give."""
    digest = hashlib.sha256(repr([list(column) for column in columns.values()]).encode()).hexdigest()[:12]
    return write_table(Path(tempfile.gettempdir()) / f"gap_{digest}.csv", columns)


def reduced_gap(values: Mapping[str, Value]) -> dict[str, Value]:
    """The valve's gap law as the models of [RTS] have it; a table serves both."""
    law = str(values["gap.law"])
    missing = [name for name in GAPS[law] if name not in values]
    if missing:
        raise InputError([f"`gap.law` is `{law}`, but `{missing[0]}` is missing. Give both."])
    if law == "table":
        return {"gap.law": "table", "gap.file": values["gap.file"]}
    if law == "linear":
        return {"gap.law": "fringing", "gap.reluctance": 0.0, "gap.slope": values["gap.slope"], "gap.fringing": 0.0}
    area, window = float(values["gap.area"]), float(values["gap.window"])
    symbols = {"gap.slope": 1.0 / (MU_0 * area), "gap.fringing": 1.0 / math.sqrt(area), "gap.window": 2.0 * window}
    return {"gap.law": "fringing", "gap.reluctance": 0.0, **symbols}


def start(values: Mapping[str, Value]) -> dict[str, Value]:
    """Where an estimator begins: where the device does, or else on the stop to which the spring pushes."""
    if "initial.position" in values:
        return {"prior.position": values["initial.position"]}
    if "stop.upper" not in values:
        return {}
    lower, upper = float(values.get("stop.lower", 0.0)), float(values["stop.upper"])
    return {"prior.position": min(max(float(values.get("spring.rest", upper)), lower), upper)}


def priors(values: Mapping[str, Value]) -> dict[str, Value]:
    """Expected resistance, and inductance at rest, N^2 / (R_gap(h_max) + R_iron0)."""
    known: dict[str, Value] = {}
    if "coil.resistance" in values:
        known["prior.resistance"] = values["coil.resistance"]
    if {"gap.law", "coil.turns", "core.reluctance", "stop.upper"} <= set(values):
        law = values if "gap.fringing" in values else reduced_gap(values)
        R = _gap_reluctance(law, float(values["stop.upper"])) + float(values["core.reluctance"])
        known["prior.inductance"] = float(values["coil.turns"]) ** 2 / R
    return known


def _gap_reluctance(law: Mapping[str, Value], h: float) -> float:
    if law["gap.law"] == "table":
        columns = read_columns(Path(str(law["gap.file"])), TABLE_UNITS)
        return float(np.interp(h, columns["gap"], columns["reluctance"]))
    window = float(law.get("gap.window", 1.0))
    closed = float(law.get("gap.reluctance", 0.0))
    return closed + float(fringing(h, float(law["gap.slope"]), float(law["gap.fringing"]), window)[0])
