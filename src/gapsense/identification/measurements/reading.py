"""Records of files, checked before they are used; messages name rows and columns, and all of them come at once."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense._os.files import number, read_bytes, why_unreadable
from gapsense.cosim.result.result import Result, read_result
from gapsense.cosim.result.sidecar import read_sidecar
from gapsense.cosim.scenario.read import RECORD, other_kind
from gapsense.fmi.tables import HEADER
from gapsense.identification.measurements import checks
from gapsense.identification.measurements.prepare import shorten, subtract_offsets, thin, turn_upright, unipolar
from gapsense.identification.measurements.record import (
    NEEDED,
    SHOWN,
    UNITS,
    Columns,
    Reading,
    Record,
    Vector,
    to_record,
)
from gapsense.identification.options import AUTO, CONVENTIONS
from gapsense.problems import InputError, listing, suggest
from gapsense.units import factor

MOST = 60  # rows above the heads
SEPARATORS = {";": '";"', "\t": "$'\\t'"}  # instead of a comma, and as a shell writes them


class Line(NamedTuple):
    """A line of a file with its number."""

    number: int
    cells: list[str]


def from_heads(lines: Sequence[Line], how: Reading) -> list[Line]:
    """Lines from the heads of the columns on, with the units of the row below them, if there is one."""
    times = how.names.get("time", "time").lower()
    heads = next((k for k, line in enumerate(lines[:MOST]) if times in map(head_of, line.cells)), 0)
    first, *rest = [*lines[heads:]] or [Line(1, [])]
    if rest and not any(is_number(cell, how.decimal) for cell in rest[0].cells):
        units = [cell.strip().strip("()[]") for cell in rest[0].cells] + [""] * len(first.cells)
        return [first._replace(cells=[*map(with_unit, first.cells, units)]), *rest[1:]]
    return [first, *rest]


def head_of(cell: str) -> str:
    """Name of a column by its head, in small letters and without the unit."""
    found = HEADER.fullmatch(cell)
    return found[1].lower() if found else ""


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number, NaN included."""
    return number(cell.replace(decimal, ".")) is not None


def with_unit(head: str, unit: str) -> str:
    """A head with its unit; one that has a unit keeps it."""
    found = HEADER.fullmatch(head)
    return f"{head.strip()} [{unit}]" if unit and found and found[1] and not found[2] else head


def other_separator(lines: Sequence[Line], separator: str) -> str:
    """Sentence on a file whose cells are separated by something else than a comma, or nothing."""
    whole = [line.cells[0] for line in lines[:MOST] if len(line.cells) == 1]
    heads = next((text for text in whole if "time" in text.lower()), whole[0] if whole else "")
    if separator != "," or (lines and len(lines[0].cells) > 1 and not heads):
        return ""
    found = next((s for s in SEPARATORS if s in heads), None)
    if found is None:
        return ""
    has_commas = any(len(line.cells) > 1 for line in lines[1:])
    more = " --decimal ," if has_commas else ""
    word = "semicolons" if found == ";" else "tabs"
    return f"the cells are separated by {word}; commas are expected. Add `--separator {SEPARATORS[found]}{more}`."


# Where a result has its signals, best first.  The mean over the step knows an edge inside it, the value does not.
SIGNALS = {
    "voltage": ("voltage_measured", "voltage_mean", "voltage"),
    "current": ("current_measured", "current"),
    "position": ("position",),
    "mode": ("mode_measured", "mode"),
}


def columns_of(file: str, result: Result, names: Mapping[str, str], problems: list[str]) -> Columns:
    """Signals of a result where they have just been sampled; a mean voltage is averaged between these instants."""
    if "time" in names:
        problems.append(f"{file}: it is a result, which has its own times. Leave out `--column time={names['time']}`.")
    chosen = {q: s for q in SIGNALS if (s := _signal(file, q, names, result, problems))}
    if any(q not in chosen for q in NEEDED[1:]):
        return Columns(file, np.array([], dtype=int), {})
    is_mean = chosen["voltage"].endswith("_mean")
    sampled = [chosen["current"]] if is_mean else [chosen["voltage"], chosen["current"]]
    at = np.flatnonzero(np.logical_and.reduce([result.stepped(signal) for signal in sampled]))
    values = {"time": result.times[at], **{q: result[s][at] for q, s in chosen.items()}}
    if is_mean:  # over the rows from one instant to the next
        means = result[chosen["voltage"]]
        running = np.concatenate(([0.0], np.cumsum(means)))
        values["voltage"] = np.concatenate((means[at[:1]], np.diff(running[at + 1]) / np.diff(at)))
    return Columns(file, at + 2, values, is_mean)


def _signal(file: str, quantity: str, names: Mapping[str, str], result: Result, problems: list[str]) -> str | None:
    """The signal that holds a quantity; of an optional one that is not unique, none."""
    if quantity in names:
        if names[quantity] in result.signals:
            return names[quantity]
        problems.append(f"{file}: no signal `{names[quantity]}`. {suggest(names[quantity], result.signals)}")
        return None
    found: list[str] = []
    for ending in SIGNALS[quantity]:
        found = found or [signal for signal in result.signals if signal.rpartition(".")[2] == ending]
    if len(found) == 1:
        return found[0]
    if quantity in NEEDED:
        what = f"{listing(found)} may be the {quantity}" if found else f"no signal of the {quantity} is recorded"
        problems.append(f"{file}: {what}. Choose one with `--column {quantity}=SIGNAL`.")
    return None


DEGREES = dict.fromkeys(("\u00b0C", "C", "K"), "degC")  # units of a temperature that are taken
HEADS = "Write `time [s],voltage [V],current [A]` as the first row."
KELVIN = 273.15  # of 0 degC


def read_columns(path: Path, how: Reading, problems: list[str]) -> Columns:
    """Columns of a CSV file, or of that of a result with its side-car; `problems` takes what is wrong with it."""
    if unknown := [name for name in how.names if name not in UNITS]:
        problems.append(f"--column {unknown[0]}: there is no such quantity. {suggest(unknown[0], UNITS)}")
    nothing = Columns(path.name, np.array([], dtype=int), {})
    if wrong := other_kind(path, RECORD):
        problems.append(wrong)
        return nothing
    if read_sidecar(path):
        return columns_of(path.name, read_result(path), how.names, problems)
    try:
        reader = csv.reader(io.StringIO(read_bytes(path).decode("utf-8-sig"), newline=""), delimiter=how.separator)
        lines = [Line(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except (UnicodeDecodeError, csv.Error) as error:
        problems.append(f"{path.name}: not a CSV file in UTF-8 ({why_unreadable(error)}). Save it as one.")
        return nothing
    if other := other_separator(lines, how.separator):
        problems.append(f"{path.name}, row 1: {other}")
        return nothing
    if not any(sum(is_number(cell, ",") for cell in line.cells) > 1 for line in lines):  # which no message tells
        what = "no row has two numbers, so it is not a record" if lines else "it is empty"
        has_heads = any("time" in map(head_of, line.cells) for line in lines)
        remedy = "Record some, below its heads." if has_heads else HEADS
        problems.append(f"{path.name}: {what}. {remedy}")
        return nothing
    return _of_lines(path.name, from_heads(lines, how), how, problems)


def _of_lines(file: str, lines: Sequence[Line], how: Reading, problems: list[str]) -> Columns:
    header, head = lines[0].cells, f"{file}, row {lines[0].number}"
    if all(is_number(cell, how.decimal) for cell in header):
        problems.append(f"{head}: numbers found, the names of the columns expected. {HEADS}")
        return Columns(file, np.array([], dtype=int), {})
    if split := [*_too_long(file, lines[1:], len(header))]:
        problems += split[:SHOWN]
        whole = [line for line in lines if len(line.cells) <= len(header)]
        if len(whole) <= len(split):  # nothing is in its column then
            return Columns(file, np.array([], dtype=int), {})
        lines = whole
    matches = [(k, match) for k, match in enumerate(map(HEADER.fullmatch, header)) if match]
    columns = {match[1].lower(): (k, match[2]) for k, match in matches}
    values: dict[str, Vector] = {}
    for name, unit in UNITS.items():
        column = how.names.get(name, name).lower()
        if column in columns:
            place, written = columns[column]
            if others := [str(k + 1) for k, match in matches if match[1].lower() == column and k != place]:
                both = " and ".join(sorted([*others, str(place + 1)], key=int))
                problems.append(f"{head}: columns {both} are both called `{column}`. Rename one.")
            cells = [(line.number, line.cells[place].strip() if place < len(line.cells) else "") for line in lines[1:]]
            if name == "temperature":
                cells = [cell for cell in cells if cell[1]]
            scale = _scale(head, place, column, DEGREES.get(written or "", written), unit, problems)
            values[name] = _numbers(file, column, cells, how.decimal, problems) * scale
            if name == "temperature":  # the mean of a column with gaps, for it is recorded slowly, in every row
                mean = float(values[name].mean()) if cells else math.nan
                values[name] = np.full(len(lines) - 1, mean - (KELVIN if written == "K" else 0.0))
        elif name in NEEDED or name in how.names:
            problems.append(_missing(head, name, column, list(columns)))
    if split:  # a row is missing, which is no gap of the times
        return Columns(file, np.array([], dtype=int), {})
    return Columns(file, np.array([line.number for line in lines[1:]], dtype=int), values)


def _too_long(file: str, lines: Sequence[Line], width: int) -> Iterator[str]:
    for row, cells in lines:
        if len(cells) > width:
            yield (
                f"{file}, row {row}: {len(cells)} cells found, {width} expected. Write numbers with a point, not a"
                ' comma, or separate the cells by semicolons and add `--separator ";" --decimal ,`.'
            )


def _missing(head: str, name: str, column: str, found: list[str]) -> str:
    unit = "" if UNITS[name] == "1" else f" [{UNITS[name]}]"
    if not any(found):
        return f"{head}: the header names no columns. {HEADS}"
    said = f"{head}: column `{column}` is missing; there are {listing(found)}. Add `{column}{unit}`"
    return f"{said}, or name the column that holds it with `--column {name}=NAME`."


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
        values = np.array([number(text) for text in texts], dtype=np.float64)  # None becomes NaN
    if np.isfinite(values).all():
        return values
    values = np.where(np.isfinite(values), values, math.nan)
    rows = [(n, f"`{text}`" if text else "empty") for (n, text), value in zip(cells, values) if math.isnan(value)]
    wrong = [f"row {n}: `{column}` is {text}" for n, text in rows]
    remedy = "Correct or interpolate it; a row that is removed leaves a gap"
    if decimal == "." and any("," in text for _, text in cells):
        remedy = "With decimal commas, add `--decimal ,`"
    problems += [f"{file}, {place}, a finite number is expected. {remedy}." for place in wrong[:SHOWN]]
    if len(wrong) > SHOWN:
        problems.append(f"{file}: `{column}` is not a finite number in {len(wrong) - SHOWN} more rows.")
    return values


def reading(
    column: Sequence[str] | None,
    convention: str = CONVENTIONS[0],
    separator: str = ",",
    decimal: str = ".",
    may_clip: bool = False,
) -> Reading:
    """How files are read, from texts; `column` has texts `QUANTITY=NAME`."""
    if convention not in (AUTO, *CONVENTIONS):
        raise ValueError(f"--voltage: `{convention}` found, one of {', '.join((AUTO, *CONVENTIONS))} expected.")
    if wrong := [pair for pair in column or [] if "=" not in pair]:
        raise ValueError(f"--column: `{wrong[0]}` found, QUANTITY=NAME expected, for instance voltage=u1.")
    for name, text in (("separator", separator), ("decimal", decimal)):
        if len(text) != 1:
            raise ValueError(f"--{name}: `{text}` found, one character expected.")
    if decimal not in ".,":
        raise ValueError(f"--decimal: `{decimal}` found, `.` or `,` expected.")
    if separator == decimal:
        raise ValueError(f'--decimal: `{decimal}` also separates the cells. Give another `--separator`, such as ";".')
    return Reading(
        names=dict(pair.split("=", 1) for pair in column or []),
        convention=convention,
        separator=separator,
        decimal=decimal,
        may_clip=may_clip,
    )


def read_records(
    files: Sequence[Path], how: Reading, period: float | None = None, needs: str = "operations"
) -> list[Record]:
    """Records of files, as `read_record` has them; all problems of all files come at once."""
    records, problems = [], []
    for file in files:
        try:
            records.append(read_record(file, how, period, needs))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return records


def read_record(
    path: Path, how: Reading | None = None, period: float | None = None, needs: str = "operations"
) -> Record:
    """Record of a file, checked; an InputError tells all that is wrong with it at once.

    Parameters
    ----------
    path : Path
        CSV file.
    how : Reading, optional
        How it is read.
    period : float, optional
        Length of an operation [s], where voltage and current do not tell it.
    needs : str
        `operations`: complete ones from rest on, to identify from; `rest`: a start at rest, to simulate; `samples`:
        nothing but sound samples, and all of them, where the others are made shorter if they are long.
    """
    how, problems = how or Reading(), list[str]()
    columns = read_columns(path, how, problems)
    problems += _sample_problems(columns, how)
    if problems:
        raise InputError(problems)
    columns, said = checks.even_out(columns)
    whole = turn_upright(to_record(columns, CONVENTIONS[0] if how.convention == AUTO else how.convention))
    record = subtract_offsets(whole)._replace(remarks=(*said, *whole.remarks, *unipolar(whole)))
    if needs != "samples":
        problems += checks.rest_problems(record, path.name)
    if needs == "operations" and not problems:
        problems += checks.operation_problems(record, path.name, period)
    if problems:
        raise InputError(problems)
    return record if needs == "samples" else shorten(thin(record), period)


def _sample_problems(columns: Columns, how: Reading) -> Iterator[str]:
    """What is wrong with columns by themselves."""
    sound = [name for name, values in columns.values.items() if np.isfinite(values).all()]
    if "time" in sound:
        yield from checks.time_problems(columns)
    for name in ("voltage", "current"):
        wrong = [*checks.size_problems(columns, name)] if name in sound else []
        yield from wrong
        if name in sound and not wrong and not how.may_clip:
            yield from checks.clipping(columns, name)
