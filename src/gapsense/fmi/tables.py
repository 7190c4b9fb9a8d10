"""Tables from CSV files for parameters.  Standard library only, because a copy travels in every FMU."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from functools import lru_cache
from itertools import accumulate
from pathlib import Path

from .sentences import say

SPLINE_ROWS = 4  # a cubic spline needs them
GRID = ("axis", "bend", "energy", "current_curve", "bend_curve", "energy_curve")  # kinds of columns of a grid
GRID_ROWS = 3  # of each block of a grid, at least
MOST_TOLD = 10  # problems of rows
LONGEST_CELL, LONGEST_LIST = 40, 200  # characters of a cell, and of a list of them, that messages show
HEADER = re.compile(r"\s*([^\[\]()]*?)\s*(?:[\[(]\s*(.*?)\s*[\])])?\s*")  # name and unit, `time [s]` or `time (s)`


def read_table(name: str | Path, columns: tuple[str, ...], folder: str | Path = ".") -> list[list[float]]:
    """Columns of a CSV file with a header, looked for in the folder first; the first must not decrease.

    `rising:y` is a column `y` that must increase from row to row, `integral:y` is the integral of `y` over the first
    column, `spline:y` the second derivative of its cubic spline; `GRID` is what `_grid` makes of three columns.
    `y [V]` says its unit, which the header of the file may leave out; another unit is refused, nothing is converted.
    A ValueError has all problems of the file: missing columns, cells without a finite number, too few rows, rows out
    of order.
    """
    if Path(name).suffix.lower() != ".csv":  # what others hold is nobody's business: messages tell cells and headers
        raise ValueError(say("no_csv_name", name, ", ".join(heads(columns))))
    tried = (Path(folder) / name, Path(name))
    path = next((p for p in tried if os.path.isfile(p)), None)  # noqa: PTH113 -- takes names that are too long
    if path is None:
        raise ValueError(say("no_file", name, ", ".join(heads(columns))))
    return [[*column] for column in _columns(path.read_bytes(), path.name, columns)]


@lru_cache(maxsize=4)  # a reset FMU reads its tables again
def _columns(content: bytes, name: str, columns: tuple[str, ...]) -> list[list[float]]:
    """Columns of a CSV file with this content."""
    try:
        lines, (header, *rows) = _rows(content)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(say("no_csv", name, error)) from error
    problems: list[str] = []
    places = _places(header, heads(columns), problems)
    if len(places) < len(heads(columns)):
        raise ValueError(say("wrong_file", name, "; ".join(problems)))
    faults: list[str] = []
    data = {c: _numbers(rows, k, c, lines, faults) for c, k in places.items()}
    if problems := [*problems, *_faults(data, lines, columns, faults)]:
        raise ValueError(say("wrong_file", name, "; ".join(problems)))
    xs, made = next(iter(data.values())), {"integral": running_integral, "spline": _spline}
    grid = _grid(*data.values()) if _is_grid(columns) else {}
    return [
        made[kind](xs, data[name]) if kind in made else grid.get(kind, data[name])
        for kind, name, _ in map(_parts, columns)
    ]


def _is_grid(columns: tuple[str, ...]) -> bool:
    return any(kind in GRID for kind, _, _ in map(_parts, columns))


def _rows(content: bytes) -> tuple[list[int], list[list[str]]]:
    """Lines of the rows that are not empty, but for the header, and all these rows: at least a header."""
    text = content.decode("utf-8-sig")
    if "\0" in text:  # some versions of the reader take it
        raise csv.Error("line contains NUL")
    reader = csv.reader(io.StringIO(text, newline=""))
    header = next(filter(None, reader), [])
    rows, lines = [header], []
    for row in reader:
        if row:
            rows.append(row)
            lines.append(reader.line_num)
    return lines, rows


def heads(columns: tuple[str, ...]) -> list[str]:
    """Header of a file with these columns, as the dialect writes it: `name [unit]`."""
    units: dict[str, str] = {}
    for _, name, unit in map(_parts, columns):
        units[name] = units.get(name) or unit
    return [f"{name} [{unit}]" if unit else name for name, unit in units.items()]


def column_name(column: str) -> str:
    """What the table of a column is called: `y` for `y [V]` and `rising:y`, `integral` for `integral:y`."""
    kind, name, _ = _parts(column)
    return name if kind in ("", "rising") else kind


def _parts(column: str) -> tuple[str, str, str]:
    """Kind, name and unit of a column; kind and unit may be empty."""
    kind, _, head = column.rpartition(":")
    found = HEADER.fullmatch(head)
    return (kind, found[1], found[2] or "") if found else (kind, head, "")


def _places(header: list[str], wanted: list[str], problems: list[str]) -> dict[str, int]:
    """Where the wanted columns are; notes those that are missing, come twice or have another unit."""
    found = [_parts(cell)[1:] for cell in header]
    names = [name.lower() for name, _ in found]
    places: dict[str, int] = {}
    for _, name, unit in map(_parts, wanted):
        at = [k for k, other in enumerate(names) if other == name]
        places |= {name: at[0]} if at else {}
        if len(at) > 1:
            problems.append(say("columns_twice", _cut(" and ".join(str(k + 1) for k in at), LONGEST_LIST), name))
        elif at and unit and found[at[0]][1] not in ("", unit):
            problems.append(say("column_unit", name, _cut(found[at[0]][1], LONGEST_CELL), unit))
    if missing := [head for head in wanted if _parts(head)[1] not in places]:
        has = _cut(", ".join(map(str.strip, header)), LONGEST_LIST) or say("no_header")
        problems.append(say("column_missing", ", ".join(missing), has))
    return places


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]}..."


def _faults(data: dict[str, list[float]], lines: list[int], columns: tuple[str, ...], faults: list[str]) -> list[str]:
    """The first `faults` of numbers, and of rows out of order; then whether there are too few rows."""
    first = next(iter(data))
    rising = {name for kind, name, _ in map(_parts, columns) if kind == "rising"}
    faults += [p for c, xs in data.items() if c in rising or c == first for p in _disorder(c, xs, lines, c in rising)]
    is_grid, xs = _is_grid(columns), data[first]
    if is_grid and not faults:
        faults += _unevenness(data, lines)
    problems = faults[:MOST_TOLD]
    if len(faults) > MOST_TOLD:
        problems.append(say("and_more", len(faults) - MOST_TOLD))
    fewest = fewest_rows(columns)
    if len(xs) < fewest or xs[-1] <= xs[0]:
        problems.append(say("few_rows", len(xs), fewest, first))
    elif is_grid and not faults and ((width := xs.count(xs[0])) < GRID_ROWS or len(xs) < SPLINE_ROWS * width):
        problems.append(say("small_grid", len(xs), width, first, SPLINE_ROWS, GRID_ROWS))
    return problems


def fewest_rows(columns: tuple[str, ...]) -> int:
    """How many rows a file with these columns has at least."""
    if _is_grid(columns):
        return SPLINE_ROWS * GRID_ROWS
    return SPLINE_ROWS if any(kind == "spline" for kind, _, _ in map(_parts, columns)) else 2


def _unevenness(data: dict[str, list[float]], lines: list[int]) -> list[str]:
    """Rows of a grid that do not fit its first block; rows of a block that do not rise from zero."""
    (x, xs), (y, ys), (z, zs) = data.items()
    faults: list[str] = []
    width = xs.count(xs[0]) if xs else 1
    for k, n in enumerate(lines):
        j = k % width
        if k >= width and (ys[k] != ys[j] or (xs[k] == xs[k - 1]) != (j > 0)):
            return [*faults, say("off_grid", n, x, y)]
        if j == 0 and (ys[k] != 0.0 or zs[k] != 0.0):
            faults.append(say("not_from_zero", n, y, z, x, ys[k], zs[k]))
        for name, values in ((y, ys), (z, zs)) if j else ():
            if not values[k] > values[k - 1]:
                faults.append(say("does_not_rise", n, name, values[k - 1], values[k]))
    return [*faults, say("off_grid", lines[-1], x, y)] if len(xs) % width else faults


def _disorder(name: str, values: list[float], lines: list[int], is_rising: bool) -> list[str]:
    """Rows at which a column decreases, or stays although it must rise."""
    return [
        say("decreases" if b < a else "does_not_rise", n, name, a, b)
        for n, a, b in zip(lines[1:], values, values[1:])
        if b < a or (is_rising and b == a)
    ]


def _numbers(rows: list[list[str]], index: int, column: str, lines: list[int], faults: list[str]) -> list[float]:
    """A column; usually all of it can be read at once."""
    try:
        texts = [row[index] for row in rows]
        values = [*map(float, texts)] if "".join(texts).isascii() else [math.nan]
    except (IndexError, ValueError):
        values = [math.nan]
    if all(map(math.isfinite, values)):
        return values
    return [_number(row, index, column, line, faults) for line, row in zip(lines, rows)]


def _number(row: list[str], index: int, column: str, line: int, faults: list[str]) -> float:
    text = row[index] if index < len(row) else ""
    digits = text.strip()
    try:
        value = float(digits) if digits.isascii() else math.nan  # digits of other scripts are none in C
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        faults.append(say("no_number", line, column, _cut(text, LONGEST_CELL)))
        return math.nan
    return value


def running_integral(xs: list[float], ys: list[float]) -> list[float]:
    """Integral of a piecewise linear `ys` over `xs`, from the first row to each row."""
    pieces = ((x1 - x0) * (y0 + y1) / 2.0 for x0, x1, y0, y1 in zip(xs, xs[1:], ys, ys[1:]))
    return list(accumulate(pieces, initial=0.0))


def _spline(xs: list[float], ys: list[float]) -> list[float]:
    """Second derivatives, at the rows, of the cubic spline without a knot at the second row and the last but one."""
    h = [b - a for a, b in zip(xs, xs[1:])]
    slopes = [(b - a) / width for a, b, width in zip(ys, ys[1:], h)]
    right = [6.0 * (b - a) for a, b in zip(slopes, slopes[1:])]
    lower, main, upper = h[:-1], [2.0 * (a + b) for a, b in zip(h, h[1:])], h[1:]
    main[0] += h[0] * (h[0] + h[1]) / h[1]  # the end values follow from their neighbours
    upper[0] -= h[0] * h[0] / h[1]
    main[-1] += h[-1] * (h[-1] + h[-2]) / h[-2]
    lower[-1] -= h[-1] * h[-1] / h[-2]
    for k in range(1, len(main)):  # tridiagonal elimination
        factor = lower[k] / main[k - 1]
        main[k] -= factor * upper[k - 1]
        right[k] -= factor * right[k - 1]
    inner = [right[-1] / main[-1]]
    for k in range(len(main) - 2, -1, -1):
        inner.append((right[k] - upper[k] * inner[-1]) / main[k])
    first = inner[-1] + (inner[-1] - inner[-2]) * h[0] / h[1]
    last = inner[0] + (inner[0] - inner[1]) * h[-1] / h[-2]
    return [first, *reversed(inner), last]


def _grid(xs: list[float], ys: list[float], zs: list[float]) -> dict[str, list[float]]:
    """What a tensor spline z(x, y) is evaluated from, at each row; z is odd in y, its rows begin at y = 0.

    The places of y, which stay at the last; the second derivative of z by y (`bend`); the integral of z over y from 0
    (`energy`); and the second derivatives by x of z, of `bend` and of `energy` (`curve`).
    """
    width = xs.count(xs[0])
    blocks = [slice(k, k + width) for k in range(0, len(xs), width)]
    bend = [value for block in blocks for value in _odd_spline(ys[block], zs[block])]
    energy = [value for block in blocks for value in _spline_integral(ys[block], zs[block], bend[block])]
    kinds = {"axis": [*ys[:width], *[ys[width - 1]] * (len(ys) - width)], "bend": bend, "energy": energy}
    for name, values in (("current", zs), ("bend", bend), ("energy", energy)):
        columns = [_spline(xs[::width], values[k::width]) for k in range(width)]
        kinds[f"{name}_curve"] = [value for row in zip(*columns) for value in row]
    return kinds


def _odd_spline(ys: list[float], zs: list[float]) -> list[float]:
    """Second derivatives of the spline through an odd function of which the half from 0 on is given."""
    return _spline([*(-y for y in ys[:0:-1]), *ys], [*(-z for z in zs[:0:-1]), *zs])[len(ys) - 1 :]


def _spline_integral(ys: list[float], zs: list[float], bends: list[float]) -> list[float]:
    """Integral of a spline from its first place on."""
    found = [0.0]
    for y0, y1, z0, z1, b0, b1 in zip(ys, ys[1:], zs, zs[1:], bends, bends[1:]):
        width = y1 - y0
        found.append(found[-1] + width * ((z0 + z1) / 2.0 - width * width * (b0 + b1) / 24.0))
    return found
