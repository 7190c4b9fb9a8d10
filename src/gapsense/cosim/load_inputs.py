"""Read `[inputs]`: constants, and signals that inputs follow, from a CSV file or a table."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from gapsense.cosim import keys
from gapsense.cosim.load_sections import by_port
from gapsense.cosim.played import Played, Vector
from gapsense.cosim.scenario import Port
from gapsense.problems import suggest
from gapsense.tables import SCALAR, Table, Value, flattened

KEYS = tuple(key.name for key in keys.SIGNAL.keys)
HEADER = re.compile(r"(.*\S)\s+\[\s*([^\[\]]*?)\s*\]")  # the blank tells a unit from the index in `x[1]`
TIME = "time"
SHOWN = 3  # problems of one kind that are told one by one


def read_inputs(table: Table, folder: Path, files: list[Path]) -> tuple[dict[Port, Value], dict[Port, Played]]:
    """Constants, `"drive.enable" = 1.0` or `[inputs.drive] enable = 1.0`, and signals; notes the files of these."""
    inputs = table.table("inputs")
    signals = dict(signal_tables(inputs.data))
    constants = inputs.child(without(inputs.data, signals), "").flat(SCALAR)
    read = {name: read_signal(inputs.child(data, name), folder, files) for name, data in signals.items()}
    return by_port(inputs, constants), by_port(inputs, {n: played for n, played in read.items() if played})


def signal_tables(data: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Tables that describe a signal, by the dotted name of the input."""
    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and "." in name and any(starts_signal(k, v) for k, v in value.items()):
            yield name, value
        elif isinstance(value, dict):
            yield from signal_tables(value, f"{name}.")


def starts_signal(key: str, value: Any) -> bool:
    """True for a key of a signal, perhaps misspelt: the value tells it from the rest of an input's name."""
    return isinstance(value, (str, list)) and bool(get_close_matches(key, KEYS, n=1))


def without(data: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """What is left without the tables of some dotted names, flat."""
    heads = tuple(f"{name}." for name in names)
    return {name: value for name, value in flattened(data) if not name.startswith(heads)}


def read_signal(table: Table, folder: Path, files: list[Path]) -> Played | None:
    """One signal, or None after noting why there is none."""
    own = table.read(keys.SIGNAL)
    sources = [key for key in ("file", "times") if own[key] is not None]
    if len(sources) != 1:
        table.note("", "a signal has either `file` and `column` or `times` and `values`. Give one of both.")
        return None
    first, second = ("file", "column") if sources == ["file"] else ("times", "values")
    for key in {"column", "values"} & set(table.data) - {second}:
        table.note(key, f"a signal with `{first}` has no `{key}`. Remove it.")
    if own[second] is None:
        table.note(second, f"missing; a signal with `{first}` needs it. Add it.")
        return None
    if first == "times":
        lines, unit, samples = None, "", tuple(np.array(own[key], dtype=np.float64) for key in ("times", "values"))
    else:
        files.append(folder / own["file"])
        column = read_column(folder / own["file"], own["column"], table)
        if column is None:
            return None
        lines, unit, samples = column
    return in_order(table, Played(samples[0], samples[1], own["interpolation"], unit), lines)


def in_order(table: Table, played: Played, lines: list[int] | None) -> Played | None:
    """The signal if its times rise, or None after noting where they do not."""
    times, values = played.times, played.values
    if times.size != values.size or times.size < 2:
        table.note("", f"{times.size} times and {values.size} values found, at least 2 of each expected. Correct it.")
        return None
    wrong = np.flatnonzero(np.diff(times) <= 0.0) + 1
    for k in wrong[:SHOWN]:
        where = f"time {k + 1}" if lines is None else f"line {lines[k]}"
        table.note("", f"{where} is {times[k]:.9g} s after {times[k - 1]:.9g} s; times must rise. Correct it.")
    return None if wrong.size else played


def read_column(path: Path, column: str, table: Table) -> tuple[list[int], str, tuple[Vector, Vector]] | None:
    """Lines, unit and samples of a column of a CSV file, or None after noting what is wrong."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, row) for row in reader if row]
    except OSError as error:
        table.note("file", f"`{path}` cannot be read: {error.strerror}. Correct the path.")
        return None
    except (UnicodeDecodeError, csv.Error) as error:
        table.note("file", f"`{path}` is not a CSV file in UTF-8 ({error}). Save it as one.")
        return None
    heads = [split_header(cell) for cell in rows[0][1]] if rows else []
    places = [place_of(heads, *split_header(name), path, table) for name in (f"{TIME} [s]", column)]
    if None in places:
        return None
    cells = [[numbers(row, place or 0) for _, row in rows[1:]] for place in places]
    bad = [(n, row) for (n, row), *pair in zip(rows[1:], *cells) if None in pair]
    for n, row in bad[:SHOWN]:
        table.note("file", f"{path}, line {n}: `{','.join(row)[:60]}` found, finite numbers expected. Correct it.")
    if bad:
        return None
    times, values = (np.array(column, dtype=np.float64) for column in cells)
    return [n for n, _ in rows[1:]], heads[places[1] or 0][1], (times, values)


def split_header(cell: str) -> tuple[str, str]:
    """Name and unit that the head of a column says; the unit is empty where there is none."""
    found = HEADER.fullmatch(cell.strip())
    return (found[1], found[2]) if found else (cell.strip(), "")


def place_of(heads: list[tuple[str, str]], name: str, unit: str, path: Path, table: Table) -> int | None:
    """Where a column is, or None after noting that it is missing, there twice, or in another unit."""
    places = [k for k, (other, _) in enumerate(heads) if other == name]
    if not places:
        hint = suggest(name, [other for other, _ in heads])
        table.note("file", f"{path}, line 1: column `{name}` is missing. {hint}")
    elif len(places) > 1:
        table.note("file", f"{path}, line 1: {len(places)} columns are called `{name}`. Rename or remove one.")
    elif unit and heads[places[0]][1] not in ("", unit):
        found = f"{path}, line 1: `{name}` is in `{heads[places[0]][1]}`, `{unit}` is expected"
        table.note("file", f"{found}, and nothing is converted. Convert the column or correct the unit.")
    else:
        return places[0]
    return None


def numbers(row: list[str], place: int) -> float | None:
    """Finite number in a row, or None."""
    try:
        value = float(row[place])
    except (ValueError, IndexError):
        return None
    return value if np.isfinite(value) else None
