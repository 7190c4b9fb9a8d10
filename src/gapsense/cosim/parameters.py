"""Parameter sets: TOML files with a description, a source and a table of values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gapsense.cosim.tables import LIST, SCALAR, TEXT, Table, Value, found, read_toml


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
        if name in out:
            table.note(name, "given twice, once as a dotted key and once in a table. Remove one.")
        elif not LIST.accepts(values):
            table.note(name, f"{found(values)} found, {LIST.name} expected. Correct the value.")
        elif len(set(values)) < len(values):
            table.note(name, "the same value is given twice. Remove one.")
        else:
            out[name] = tuple(located(name, value, folder, table) for value in values)
    return out


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
