"""Records of measured voltage and current, from a user's CSV file or from the results of a run.

A user's file has a header with names and units, `time [s], voltage [V], current [A]`, and may have `position [m]` and
`mode [1]`; units may carry a prefix (`ms`, `mA`).  Of the results of `gapsense run` the signals are found by their
names and read at the instants at which their components have stepped.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim.record import Result, read_result
from gapsense.fmi.tables import HEADER
from gapsense.problems import listing, suggest
from gapsense.units import factor

Vector = npt.NDArray[np.float64]

UNITS = {"time": "s", "voltage": "V", "current": "A", "position": "m", "mode": "1"}
NEEDED = ("time", "voltage", "current")
SHOWN = 3  # rows that are named for each kind of problem

# Where a result has its signals, best first.  The mean over the step knows an edge inside it, the value does not.
SIGNALS = {
    "voltage": ("voltage_measured", "voltage_mean", "voltage"),
    "current": ("current_measured", "current"),
    "position": ("position",),
    "mode": ("mode_measured", "mode"),
}
CONVENTIONS = ("trapezoid", "end", "start")


class Columns(NamedTuple):
    """What a file holds, in SI units; `rows` are the numbers of its lines, NaN stands for what is no number."""

    file: str
    rows: npt.NDArray[np.int_]
    values: Mapping[str, Vector]
    is_mean: bool = False  # the voltage is the mean over the interval before each sample


class Offset(NamedTuple):
    """What a signal is at rest, where it should be zero."""

    value: float
    error: float  # standard error


class Record(NamedTuple):
    """Uniform samples."""

    name: str  # file without folder and ending
    times: Vector  # [s]
    voltage: Vector  # [V]
    current: Vector  # [A]
    halves: Vector  # voltage during the two halves of the interval before each sample (n, 2) [V]; the first: no meaning
    position: Vector | None  # [m], where it was recorded
    mode: Vector | None  # [1], likewise
    rows: npt.NDArray[np.int_]  # lines of the file, for messages
    offsets: Mapping[str, Offset] = {}  # of voltage and current, which have been subtracted

    @property
    def applied(self) -> Vector:
        """Mean voltage over the interval before each sample [V]."""
        return np.asarray(self.halves.mean(axis=1))

    @property
    def dt(self) -> float:
        """Sampling period [s]."""
        return float((self.times[-1] - self.times[0]) / (self.times.size - 1))


def read_columns(path: Path, names: Mapping[str, str], problems: list[str]) -> Columns:
    """Columns of a user's CSV file, or of that of a result with its side-car; `problems` takes what is wrong with it.

    `names` are the columns or signals that hold a quantity (`voltage`, `current`, ...), where its name does not tell.
    """
    if unknown := [name for name in names if name not in UNITS or name == "time"]:
        problems.append(f"--column {unknown[0]}: {suggest(unknown[0], [n for n in UNITS if n != 'time'])}")
    if path.with_suffix(".json").is_file() and '"gapsense result' in path.with_suffix(".json").read_text("utf-8"):
        return _of_result(path.name, read_result(path), names, problems)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except (UnicodeDecodeError, csv.Error) as error:
        problems.append(f"{path.name}: not a CSV file in UTF-8 ({error}). Save it as one.")
        return Columns(path.name, np.array([], dtype=int), {})
    return _of_lines(path.name, lines, names, problems)


def _of_lines(file: str, lines: list[tuple[int, list[str]]], names: Mapping[str, str], problems: list[str]) -> Columns:
    header = lines[0][1] if lines else []
    matches = [(k, match) for k, match in enumerate(map(HEADER.fullmatch, header)) if match]
    columns = {match[1].lower(): (k, match[2]) for k, match in matches}
    values: dict[str, Vector] = {}
    for name, unit in UNITS.items():
        column = names.get(name, name).lower()
        if column in columns:
            place, written = columns[column]
            problems += _twice(file, column, [k + 1 for k, match in matches if match[1].lower() == column])
            cells = [(n, row[place].strip() if place < len(row) else "") for n, row in lines[1:]]
            scale = _scale(file, place, column, written, unit, problems)
            values[name] = _numbers(file, column, cells, problems) * scale
        elif name in NEEDED or name in names:
            problems.append(_missing(file, name, column, list(columns)))
    problems += [
        f"{file}, row {n}: {len(row)} cells found, {len(header)} expected. Write numbers with a point, not a comma."
        for n, row in lines[1:]
        if len(row) > len(header)
    ][:SHOWN]
    return Columns(file, np.array([number for number, _ in lines[1:]], dtype=int), values)


def _twice(file: str, column: str, places: list[int]) -> list[str]:
    """That several columns have the name of one that is read, if so."""
    if len(places) == 1:
        return []
    return [f"{file}, row 1: columns {' and '.join(map(str, places))} are both called `{column}`. Rename one."]


def _missing(file: str, name: str, column: str, found: list[str]) -> str:
    unit = "" if UNITS[name] == "1" else f" [{UNITS[name]}]"
    if not any(found):
        return f"{file}, row 1: the header names no columns. Write `time [s],voltage [V],current [A]` as the first row."
    said = f"{file}, row 1: column `{column}` is missing; there are {listing(found)}. Add `{column}{unit}`"
    return f"{said}." if name == "time" else f"{said}, or name the column that holds it with `--column {name}=NAME`."


def _scale(file: str, place: int, column: str, written: str | None, unit: str, problems: list[str]) -> float:
    """Factor from the unit written in the header to the SI unit; 1 after noting a wrong one."""
    scale = factor(written or "", unit)
    if scale is None:
        found = "no unit" if written is None else f"unit `{written}`"
        problems.append(
            f"{file}, row 1, column {place + 1}: `{column}` has {found}; `{unit}` is expected, also with a prefix "
            f"(`m{unit}`). Write `{column} [{unit}]`."
        )
    return 1.0 if scale is None else scale


def _numbers(file: str, column: str, cells: list[tuple[int, str]], problems: list[str]) -> Vector:
    """Values of a column; cells that hold no finite number are noted and become NaN."""
    values = np.array([_number(text) for _, text in cells])
    wrong = [f"row {n}: `{column}` is `{text}`" for (n, text), value in zip(cells, values) if not math.isfinite(value)]
    problems += [f"{file}, {place}, a finite number is expected. Correct or remove the row." for place in wrong[:SHOWN]]
    if len(wrong) > SHOWN:
        problems.append(f"{file}: `{column}` is no finite number in {len(wrong) - SHOWN} more rows.")
    return values


def _number(text: str) -> float:
    try:
        return value if math.isfinite(value := float(text)) else math.nan
    except ValueError:
        return math.nan


def _of_result(file: str, result: Result, names: Mapping[str, str], problems: list[str]) -> Columns:
    """Signals of a result where they have just been sampled; a mean voltage is averaged between these instants."""
    chosen = {q: s for q in SIGNALS if (s := _signal(file, q, names, result, problems))}
    if any(q not in chosen for q in NEEDED[1:]):
        return Columns(file, np.array([], dtype=int), {})
    is_mean = chosen["voltage"].endswith("_mean")
    sampled = [chosen["current"]] if is_mean else [chosen["voltage"], chosen["current"]]
    at = np.flatnonzero(np.logical_and.reduce([result.stepped(signal) for signal in sampled]))
    values = {"time": result.times[at], **{q: result[s][at] for q, s in chosen.items()}}
    if is_mean:
        values["voltage"] = _averaged(result[chosen["voltage"]], at)
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


def _averaged(means: Vector, at: npt.NDArray[np.int_]) -> Vector:
    """Mean over the rows from one of `at` to the next."""
    running = np.concatenate(([0.0], np.cumsum(means)))
    return np.concatenate((means[at[:1]], np.diff(running[at + 1]) / np.diff(at)))


def to_record(columns: Columns, convention: str = "trapezoid") -> Record:
    """Record of columns without problems.

    The convention says what the voltage between two samples is, which they alone do not tell: `trapezoid`, up to the
    middle that of the first, then that of the second (an edge lies half-way on the average); `end` or `start`, that of
    the sample at the end or the start (held by the drive).  Means over the intervals are taken as they are.
    """
    v = columns.values["voltage"]
    before = np.concatenate((v[:1], v[:-1]))
    chosen = "end" if columns.is_mean else convention
    return Record(
        name=Path(columns.file).stem,
        times=columns.values["time"],
        voltage=v,
        current=columns.values["current"],
        halves=np.stack((v if chosen == "end" else before, before if chosen == "start" else v), axis=1),
        position=columns.values.get("position"),
        mode=columns.values.get("mode"),
        rows=columns.rows,
    )
