"""Tables from CSV files for parameters.  Standard library only, because a copy travels in every FMU."""

from __future__ import annotations

import csv
import math
from itertools import accumulate
from pathlib import Path


def read_table(path: Path, columns: tuple[str, ...]) -> list[list[float]]:
    """Columns of a CSV file with a header; the first must not decrease; `integral:y` is the integral of `y` over it.

    Raises
    ------
    ValueError
        With all problems of the file: missing columns, cells without a finite number, too few rows, rows out of order.
    """
    if not path.is_file():
        raise ValueError(f"`{path}` is not a file. Give the path of a CSV file with the columns {', '.join(columns)}.")
    read = list(dict.fromkeys(c.removeprefix("integral:") for c in columns))
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
    data = {c: [_number(row, header.index(c), c, n, problems) for n, row in rows[1:]] for c in read}
    xs = data[read[0]]
    problems += [
        f"row {n}: `{read[0]}` decreases from {a:g} to {b:g}" for (n, _), a, b in zip(rows[2:], xs, xs[1:]) if b < a
    ]
    if len(xs) < 2 or xs[-1] <= xs[0]:
        problems.append(f"{len(xs)} rows, but at least 2 with different `{read[0]}` are needed")
    if problems:
        raise ValueError(f"{path.name}: {'; '.join(problems)}. Correct the file.")
    return [data[c] if c in data else _integral(xs, data[c.partition(":")[2]]) for c in columns]


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


def _integral(xs: list[float], ys: list[float]) -> list[float]:
    pieces = ((x1 - x0) * (y0 + y1) / 2.0 for x0, x1, y0, y1 in zip(xs, xs[1:], ys, ys[1:]))
    return list(accumulate(pieces, initial=0.0))
