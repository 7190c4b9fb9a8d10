"""Tables from CSV files for parameters.  Standard library only, because a copy travels in every FMU."""

from __future__ import annotations

import csv
import math
from itertools import accumulate
from pathlib import Path

SPLINE_ROWS = 4  # a cubic spline needs them


def read_table(path: Path, columns: tuple[str, ...]) -> list[list[float]]:
    """Columns of a CSV file with a header; the first must not decrease.

    `rising:y` is a column `y` that must increase from row to row, `integral:y` is the integral of `y` over the first
    column, `spline:y` the second derivative of its cubic spline.  A ValueError has all problems of the file: missing
    columns, cells without a finite number, too few rows, rows out of order.
    """
    if not path.is_file():
        raise ValueError(f"`{path}` is not a file. Give the path of a CSV file with the columns {', '.join(columns)}.")
    marks = [c.rpartition(":")[::2] for c in columns]  # kind and name; the kind is empty for a plain column
    read = list(dict.fromkeys(name for _, name in marks))
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, row) for row in reader if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path.name}: not a CSV file in UTF-8 ({error}). Save it as one.") from error
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    missing = [c for c in read if c not in header]
    if missing:
        raise ValueError(
            f"{path.name}: column {', '.join(missing)} is missing; the header has {', '.join(header) or 'nothing'}."
        )
    problems: list[str] = []
    lines = [n for n, _ in rows[1:]]
    data = {c: [_number(row, header.index(c), c, n, problems) for n, row in rows[1:]] for c in read}
    xs, rising = data[read[0]], {name for kind, name in marks if kind == "rising"}
    for name in (c for c in read if c in rising or c == read[0]):
        problems += _disorder(name, data[name], lines, name in rising)
    fewest = SPLINE_ROWS if any(kind == "spline" for kind, _ in marks) else 2
    if len(xs) < fewest or xs[-1] <= xs[0]:
        problems.append(f"{len(xs)} rows, but at least {fewest} with different `{read[0]}` are needed")
    if problems:
        raise ValueError(f"{path.name}: {'; '.join(problems)}. Correct the file.")
    made = {"integral": running_integral, "spline": _spline}
    return [made[kind](xs, data[name]) if kind in made else data[name] for kind, name in marks]


def column_name(column: str) -> str:
    """What the table of a column is called: `y` for `y` and `rising:y`, `integral` for `integral:y`."""
    kind, _, name = column.rpartition(":")
    return name if kind in ("", "rising") else kind


def _disorder(name: str, values: list[float], lines: list[int], is_rising: bool) -> list[str]:
    """Rows at which a column decreases, or stays although it must rise."""
    return [
        f"row {n}: `{name}` {'decreases' if b < a else 'does not rise'} from {a:g} to {b:g}"
        for n, a, b in zip(lines[1:], values, values[1:])
        if b < a or (is_rising and b == a)
    ]


def _number(row: list[str], index: int, column: str, line: int, problems: list[str]) -> float:
    text = row[index] if index < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problems.append(f"row {line}: `{column}` is `{text}`, not a finite number")
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
        inner.insert(0, (right[k] - upper[k] * inner[0]) / main[k])
    first = inner[0] + (inner[0] - inner[1]) * h[0] / h[1]
    last = inner[-1] + (inner[-1] - inner[-2]) * h[-1] / h[-2]
    return [first, *inner, last]
