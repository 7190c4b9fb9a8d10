"""Files that are complete or absent: CSV with exact numbers, JSON, hashes."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import numpy.typing as npt

Columns = Mapping[str, npt.NDArray[Any]]


def write_atomically(path: Path, write: Callable[[TextIO], None]) -> None:
    """Write to a temporary name in the same folder, then rename; a failure leaves the old file as it was."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    os.umask(mask := os.umask(0))  # which temporary files do not follow by themselves
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            write(file)
        Path(name).chmod(0o666 & ~mask)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_columns(file: TextIO, columns: Columns) -> None:
    """CSV with quoted names and texts and the shortest numbers that read back to the same bits."""
    file.write(",".join(f'"{name}"' for name in columns) + "\n")
    for row in zip(*(column.tolist() for column in columns.values())):
        file.write(",".join(map(cell, row)) + "\n")


def cell(value: Any) -> str:
    """A number, or a text in quotes."""
    return '"{}"'.format(value.replace('"', '""')) if isinstance(value, str) else repr(value)


def read_columns(path: Path) -> dict[str, npt.NDArray[np.float64]]:
    """Columns of a CSV file by name."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file)
        names = next(rows, [])
        data = [[float(value) for value in row] for row in rows]
    ragged = next((index for index, row in enumerate(data, start=2) if len(row) != len(names)), None)
    if ragged is not None:
        raise ValueError(f"{path}, line {ragged}: {len(data[ragged - 2])} values found, {len(names)} expected.")
    table = np.array(data, dtype=np.float64).reshape(len(data), len(names))
    return {name: np.ascontiguousarray(table[:, index]) for index, name in enumerate(names)}


def write_json(file: TextIO, data: Any) -> None:
    """JSON for people and programs: indented, in the order given."""
    json.dump(data, file, indent=2)
    file.write("\n")


def read_json(path: Path) -> Any:
    """Content of a JSON file."""
    return json.loads(path.read_text(encoding="utf-8"))


def sha256(path: Path) -> str:
    """Hash of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
