"""Parameter sets: TOML files with a description, a source and a table of values."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path
from typing import NamedTuple

from gapsense.problems import suggest
from gapsense.tables import SCALAR, TABLE, TEXT, TEXTS, Key, Section, Table, Value, read_toml


def is_file(name: str, value: Value) -> bool:
    """True for a parameter that names a file: its name is `file` or ends in `.file`, and it is not empty."""
    return isinstance(value, str) and bool(value) and name.rpartition(".")[2] == "file"


VALUES = Section(
    "[values]",
    "A file that describes a device. Each component that is given it takes the parameters that it has.",
    free=Key(
        "<parameter>",
        SCALAR,
        "Value of the parameter, in its unit",
        '"coil.resistance" = 48.0',
        is_dotted=True,
        is_path=is_file,
    ),
)
PARAMETER_SET = Section(
    "",
    "Parameter set",
    (
        Key("description", TEXT, "What it describes", '"The valve on my desk"', default=""),
        Key("source", TEXT, "Where the values are from", '"data sheet"', default=""),
        Key(
            "assumed",
            TEXTS,
            "Parameters whose values are only assumed: `identify --assume` marks them, and later commands repeat it",
            '["coil.resistance"]',
            default=[],
            is_other=True,
        ),
        Key("values", TABLE, "Parameters", required=True, section=VALUES),
    ),
)


class ParameterSet(NamedTuple):
    """Content of a parameter-set file."""

    values: dict[str, Value]  # by variable name
    assumed: tuple[str, ...] = ()  # names of those that are only assumed


def read_parameters(path: Path, problems: list[str]) -> dict[str, Value]:
    """Values of a parameter-set file by variable name; files named in it are relative to it."""
    return read_set(path, problems).values


def read_set(path: Path, problems: list[str]) -> ParameterSet:
    """Values of a parameter-set file, and which of them are assumed."""
    data = read_toml(path, problems)
    if data is None:
        return ParameterSet({})
    if "components" in data:
        problems.append(f"{path.name}: it is a scenario. Name a parameter set, a file with a table `[values]`.")
        return ParameterSet({})
    table = Table(data, path.name, "", problems)
    marked = table.read(PARAMETER_SET)["assumed"]
    if "values" not in data:
        table.note("values", "missing; a table of parameter values is expected. Add `[values]`.")
    values = located_values(table.table("values"), path.parent)
    for name in marked:
        if name not in values:
            table.note("assumed", f"`{name}` has no value in `[values]`. {suggest(name, values)} Correct or remove it.")
    return ParameterSet(values, tuple(marked))


BEND, CORE = "core.bend", {"core.reluctance", "core.saturation"}


def core_problem(values: Mapping[str, Value], names: Container[str]) -> str:
    """Sentence on a core with a bend of its own, which a component with the parameters `names` has not; or nothing."""
    if not values.get(BEND) or BEND in names or not all(name in names for name in CORE):
        return ""
    return (
        f"`{BEND}` is {values[BEND]:g} 1/H, but this component has no such parameter: `core.reluctance` and"
        f" `core.saturation` would be those of another core. Leave out the bend and give both for a core without it,"
        " or use a `TableActuator`."
    )


def located_values(table: Table, folder: Path) -> dict[str, Value]:
    """Values of a table by dotted name, with the files among them as absolute paths."""
    return {name: locate_file(name, value, folder, table) for name, value in table.flat(SCALAR).items()}


def locate_file(name: str, value: Value, folder: Path, table: Table) -> Value:
    """Make the path of a file absolute; it must exist. Other values stay."""
    if not is_file(name, value):
        return value
    path = (folder / str(value)).resolve()
    if not path.is_file():
        table.note(name, f"there is no file `{path}`. Correct the path; it is relative to {table.file}.")
    return str(path)
