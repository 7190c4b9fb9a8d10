"""Columns of a user's CSV file, or of the results of a run.

A file has a header with names and units, `time [s], voltage [V], current [A]`, and may have `position [m]` and
`mode [1]`; units may carry a prefix (`ms`, `mA`).
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gapsense._os.files import unread
from gapsense._os.plain_files import read_bytes
from gapsense.cosim.result.result import read_result
from gapsense.cosim.result.sidecar import read_sidecar
from gapsense.cosim.scenario.kinds import RECORD, other_kind
from gapsense.fmi.tables import HEADER
from gapsense.identification.measurements.heads import Line, from_heads, is_number, other_separator
from gapsense.identification.measurements.of_result import columns_of
from gapsense.identification.measurements.record import NEEDED, SHOWN, UNITS, Columns, Reading, Vector
from gapsense.problems import listing, suggest
from gapsense.units import factor

DEGREES = dict.fromkeys(("\u00b0C", "C", "K"), "degC")  # units of a temperature that are taken
HEADS = "Write `time [s],voltage [V],current [A]` as the first row."
KELVIN = 273.15  # of 0 degC


def read_columns(path: Path, how: Reading, problems: list[str]) -> Columns:
    """Columns of a CSV file, or of that of a result with its side-car; `problems` takes what is wrong with it."""
    if unknown := [name for name in how.names if name not in UNITS or name == "time"]:
        problems.append(f"--column {unknown[0]}: {suggest(unknown[0], [n for n in UNITS if n != 'time'])}")
    if wrong := other_kind(path, RECORD):
        problems.append(wrong)
        return Columns(path.name, np.array([], dtype=int), {})
    if read_sidecar(path):
        return columns_of(path.name, read_result(path), how.names, problems)
    nothing = Columns(path.name, np.array([], dtype=int), {})
    try:
        reader = csv.reader(io.StringIO(read_bytes(path).decode("utf-8-sig"), newline=""), delimiter=how.separator)
        lines = [Line(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except (UnicodeDecodeError, csv.Error) as error:
        problems.append(f"{path.name}: not a CSV file in UTF-8 ({unread(error)}). Save it as one.")
        return nothing
    if other := other_separator(lines, how.separator):
        problems.append(f"{path.name}, row 1: {other}")
        return nothing
    if not any(sum(is_number(cell, ",") for cell in line.cells) > 1 for line in lines):  # which no message tells
        problems.append(f"{path.name}: no row has two numbers, so it is no record. {HEADS}")
        return nothing
    return _of_lines(path.name, from_heads(lines, how.decimal), how, problems)


def _of_lines(file: str, lines: Sequence[Line], how: Reading, problems: list[str]) -> Columns:
    header, head = lines[0].cells, f"{file}, row {lines[0].number}"
    if split := [*_too_long(file, lines[1:], len(header))][:SHOWN]:  # nothing is in its column then
        problems += split
        return Columns(file, np.array([], dtype=int), {})
    matches = [(k, match) for k, match in enumerate(map(HEADER.fullmatch, header)) if match]
    columns = {match[1].lower(): (k, match[2]) for k, match in matches}
    values: dict[str, Vector] = {}
    for name, unit in UNITS.items():
        column = how.names.get(name, name).lower()
        if column in columns:
            place, written = columns[column]
            problems += _twice(head, column, [k + 1 for k, match in matches if match[1].lower() == column])
            cells = [(line.number, line.cells[place].strip() if place < len(line.cells) else "") for line in lines[1:]]
            if name == "temperature":
                cells = [cell for cell in cells if cell[1]]
            scale = _scale(head, place, column, DEGREES.get(written or "", written), unit, problems)
            values[name] = _numbers(file, column, cells, how.decimal, problems) * scale
            if name == "temperature":
                values[name] = _mean(values[name], written, len(lines) - 1)
        elif name in NEEDED or name in how.names:
            problems.append(_missing(head, name, column, list(columns)))
    return Columns(file, np.array([line.number for line in lines[1:]], dtype=int), values)


def _too_long(file: str, lines: Sequence[Line], width: int) -> Iterator[str]:
    for number, cells in lines:
        if len(cells) > width:
            yield (
                f"{file}, row {number}: {len(cells)} cells found, {width} expected. Write numbers with a point, not a"
                ' comma, or separate the cells by semicolons and add `--separator ";" --decimal ,`.'
            )


def _twice(head: str, column: str, places: list[int]) -> list[str]:
    """That several columns have the name of one that is read, if so."""
    if len(places) == 1:
        return []
    return [f"{head}: columns {' and '.join(map(str, places))} are both called `{column}`. Rename one."]


def _missing(head: str, name: str, column: str, found: list[str]) -> str:
    unit = "" if UNITS[name] == "1" else f" [{UNITS[name]}]"
    if not any(found):
        return f"{head}: the header names no columns. {HEADS}"
    said = f"{head}: column `{column}` is missing; there are {listing(found)}. Add `{column}{unit}`"
    return f"{said}." if name == "time" else f"{said}, or name the column that holds it with `--column {name}=NAME`."


def _scale(head: str, place: int, column: str, written: str | None, unit: str, problems: list[str]) -> float:
    """Factor from the unit written in the header to the SI unit; 1 after noting a wrong one."""
    scale = factor(written or "", unit)
    if scale is None:
        found = "no unit" if written is None else f"unit `{written}`"
        problems.append(
            f"{head}, column {place + 1}: `{column}` has {found}; `{unit}` is expected, also with a prefix "
            f"(`m{unit}`). Write `{column} [{unit}]`."
        )
    return 1.0 if scale is None else scale


def _numbers(file: str, column: str, cells: list[tuple[int, str]], decimal: str, problems: list[str]) -> Vector:
    """Values of a column; cells that hold no finite number are noted and become NaN."""
    texts = [text.replace(decimal, ".") if decimal != "." else text for _, text in cells]
    try:
        values = np.array(texts, dtype=np.str_).astype(np.float64)  # at once: a record may have a million
    except ValueError:
        values = np.array([_number(text) for text in texts])
    if np.isfinite(values).all():
        return values
    values = np.where(np.isfinite(values), values, math.nan)
    wrong = [f"row {n}: `{column}` is `{text}`" for (n, text), value in zip(cells, values) if math.isnan(value)]
    remedy = "Correct or remove the row"
    if decimal == "." and any("," in text for _, text in cells):
        remedy = "With decimal commas, add `--decimal ,`"
    problems += [f"{file}, {place}, a finite number is expected. {remedy}." for place in wrong[:SHOWN]]
    if len(wrong) > SHOWN:
        problems.append(f"{file}: `{column}` is no finite number in {len(wrong) - SHOWN} more rows.")
    return values


def _mean(temperatures: Vector, written: str | None, rows: int) -> Vector:
    """Mean temperature in degC, in every row: such columns have gaps, for they are recorded slowly."""
    mean = float(temperatures.mean()) if temperatures.size else math.nan
    return np.full(rows, mean - (KELVIN if written == "K" else 0.0))


def _number(text: str) -> float:
    try:
        return value if math.isfinite(value := float(text)) else math.nan
    except ValueError:
        return math.nan
