"""Parameter sets: TOML files with a description, a source and a table of values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gapsense.files import read_columns
from gapsense.tables import LIST, SCALAR, TEXT, Table, Value, found, read_toml

ROWS = "rows"  # of `[sweep]`: a file, no parameter


def read_parameters(path: Path, problems: list[str]) -> dict[str, Value]:
    """Values of a parameter-set file by variable name; files named in it are relative to it."""
    data = read_toml(path, problems)
    if data is None:
        return {}
    table = Table(data, path.name, "", problems)
    table.take("description", TEXT)
    table.take("source", TEXT)
    if "values" not in data:
        table.note("values", "missing; a table of parameter values is expected. Add `[values]`.")
    values = flat_values(table.table("values"), path.parent)
    table.finish()
    return values


def flat_values(table: Table, folder: Path) -> dict[str, Value]:
    """Values of a table by dotted name; `[coil] resistance` means the same as `"coil.resistance"`."""
    out: dict[str, Value] = {}
    for name, value in flattened(table.data, ""):
        if name in out:
            table.note(name, "given twice, once as a dotted key and once in a table. Remove one.")
        elif not SCALAR.accepts(value):
            table.note(name, f"{found(value)} found, {SCALAR.name} expected. Correct the value.")
        else:
            out[name] = located(name, value, folder, table)
    return out


def flat_lists(table: Table, folder: Path) -> dict[str, tuple[Value, ...]]:
    """Lists of different values by dotted name, for a sweep."""
    out: dict[str, tuple[Value, ...]] = {}
    for name, values in flattened(table.data, ""):
        if name == ROWS:
            continue
        if name in out:
            table.note(name, "given twice, once as a dotted key and once in a table. Remove one.")
        elif not LIST.accepts(values):
            table.note(name, f"{found(values)} found, {LIST.name} expected. Correct the value.")
        elif len(set(values)) < len(values):
            table.note(name, "the same value is given twice. Remove one.")
        else:
            out[name] = tuple(located(name, value, folder, table) for value in values)
    return out


def read_rows(path: Path, table: Table) -> tuple[list[str], list[list[float]]]:
    """Names and rows of a CSV file in which each row is what one run of a sweep is given."""
    try:
        columns = read_columns(path)
    except (OSError, ValueError) as error:
        problem = f"{path}: there is no such file" if isinstance(error, OSError) else str(error).rstrip(".")
        table.note(ROWS, f"{problem}. A CSV file of numbers is expected, with a column per parameter. Correct it.")
        return [], []
    twice = [name for name, _ in flattened(table.data, "") if name in columns]
    if twice:
        table.note(ROWS, f"`{twice[0]}` is given in {path.name} and in `[sweep]` too. Keep one.")
    if not any(column.size for column in columns.values()):
        table.note(ROWS, f"{path.name} has no rows. Add one per run.")
    return list(columns), [list(map(float, row)) for row in zip(*columns.values())]


def flattened(data: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Pairs of dotted name and value, depth first."""
    for key, value in data.items():
        if isinstance(value, dict):
            yield from flattened(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def is_file(name: str, value: Value) -> bool:
    """True for a parameter that names a file: its name is `file` or ends in `.file`, and it is not empty."""
    return isinstance(value, str) and bool(value) and name.rpartition(".")[2] == "file"


def located(name: str, value: Value, folder: Path, table: Table) -> Value:
    """The value; a file becomes an absolute path, and must exist."""
    if not is_file(name, value):
        return value
    path = (folder / str(value)).resolve()
    if not path.is_file():
        table.note(name, f"there is no file `{path}`. Correct the path; it is relative to {table.file}.")
    return str(path)
