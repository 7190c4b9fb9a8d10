"""Read `[inputs]`: constants, and signals that inputs follow, from a CSV file or a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import SHOWN, Sheet, no_numbers, number, read_sheet, split_header
from gapsense.cosim.scenario.elements import Port
from gapsense.cosim.scenario.input_signals import Played, Vector
from gapsense.cosim.scenario.keys import SIGNAL
from gapsense.cosim.scenario.read_sections import by_port
from gapsense.problems import suggest
from gapsense.tables import SCALAR, Table, Value, flattened

KEYS = tuple(key.name for key in SIGNAL.keys)
TIME = "time"


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
    own = table.read(SIGNAL)
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
    with np.errstate(over="ignore"):
        widths, heights = np.diff(times), np.diff(values)
    if not (np.isfinite(widths).all() and np.isfinite(heights).all()):
        table.note("", "between two samples there is more than a number can hold. Correct the values.")
        return None
    wrong = np.flatnonzero(widths <= 0.0) + 1
    for k in wrong[:SHOWN]:
        where = f"time {k + 1}" if lines is None else f"line {lines[k]}"
        table.note("", f"{where} is {times[k]:.9g} s after {times[k - 1]:.9g} s; times must rise. Correct it.")
    return None if wrong.size else played


def read_column(path: Path, column: str, table: Table) -> tuple[list[int], str, tuple[Vector, Vector]] | None:
    """Lines, unit and samples of a column of a CSV file, or None after noting what is wrong."""
    problems: list[str] = []
    try:
        sheet = read_sheet(path, problems)
    except OSError as error:
        table.note("file", f"`{path}` cannot be read: {error.strerror}. Correct the path.")
        return None
    places = [place_of(sheet, *split_header(name), problems) for name in (f"{TIME} [s]", column)]
    found = [k for k in places if k is not None]
    cells = [[(i, k, row[k]) for i, row in enumerate(sheet.rows)] for k in found]
    bad = [(sheet.place(i, k), text) for own in cells for i, k, text in own if not is_finite(text)]
    told = [f"{place}: `{text}` found, a finite number expected. Correct it." for place, text in bad[:SHOWN]]
    problems += told if sheet.is_table else no_numbers(sheet)
    for problem in problems:
        table.note("file", problem)
    if problems:
        return None
    times, values = (np.array([float(text) for *_, text in own], dtype=np.float64) for own in cells)
    return sheet.lines, sheet.units[found[1]], (times, values)


def place_of(sheet: Sheet, name: str, unit: str, problems: list[str]) -> int | None:
    """Where a column is, or None after noting that it is missing or in another unit."""
    if name not in sheet.names:
        problems.append(f"{sheet.path}, line 1: column `{name}` is missing. {suggest(name, sheet.known)}")
        return None
    place = sheet.names.index(name)
    if unit and sheet.units[place] not in ("", unit):
        said = f"{sheet.path}, line 1: `{name}` is in `{sheet.units[place]}`, `{unit}` is expected"
        problems.append(f"{said}, and nothing is converted. Convert the column or correct the unit.")
    return place


def is_finite(text: str) -> bool:
    """True for the text of a finite number."""
    value = number(text)
    return value is not None and math.isfinite(value)
