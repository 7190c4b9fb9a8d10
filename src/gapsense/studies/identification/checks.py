"""Checks of a record before it is used; every message names rows and columns, and all of them come at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from gapsense.problems import InputError
from gapsense.studies.identification.operations import noise, operations, resolution, starts, true_runs
from gapsense.studies.identification.record import CONVENTIONS, SHOWN, Columns, Record, Vector, read_columns, to_record
from gapsense.studies.identification.rest import without_offsets

FEWEST_SAMPLES = 8
JITTER = 0.01  # largest deviation of a time step from their median, relative
REST = 0.01  # largest current at rest, and largest change over a period, relative to the largest current
SIGMAS = 4.0
CLIPPED = 5  # equal samples at the end of the range
STEEP = 1e-3  # change before a flat end of the range that no settling current has, relative to the range


def read_records(
    files: Sequence[Path],
    column: Sequence[str] | None,
    convention: str = CONVENTIONS[0],
    period: float | None = None,
    needs: str = "operations",
) -> list[Record]:
    """Records of files, as `read_record` has them; `column` has texts `QUANTITY=NAME`.

    All problems of all files come at once.
    """
    if convention not in CONVENTIONS:
        raise ValueError(f"--voltage: `{convention}` found, one of {', '.join(CONVENTIONS)} expected.")
    if wrong := [pair for pair in column or [] if "=" not in pair]:
        raise ValueError(f"--column: `{wrong[0]}` found, QUANTITY=NAME expected, for instance voltage=u1.")
    names = dict(pair.split("=", 1) for pair in column or [])
    records, problems = [], []
    for file in files:
        try:
            records.append(read_record(file, names, convention, period, needs))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return records


def read_record(
    path: Path,
    names: Mapping[str, str] | None = None,
    convention: str = "trapezoid",
    period: float | None = None,
    needs: str = "operations",
) -> Record:
    """Record of a file, checked; an InputError tells all that is wrong with it at once.

    Parameters
    ----------
    path : Path
        CSV file.
    names : mapping, optional
        See `read_columns`.
    convention : str
        See `to_record`.
    period : float, optional
        Length of an operation [s], where rising edges of the voltage do not tell it.
    needs : str
        `operations`: complete ones from rest on, to identify from; `rest`: a start at rest, to simulate; `samples`:
        nothing but sound samples.
    """
    problems: list[str] = []
    columns = read_columns(path, names or {}, problems)
    sound = [name for name, values in columns.values.items() if np.isfinite(values).all()]
    if "time" in sound:
        problems += _time_problems(columns)
    for name in ("voltage", "current"):
        if name in sound:
            problems += _clipping(columns, name)
    if not problems and needs != "samples":
        record = to_record(columns, convention)
        record = without_offsets(record)
        problems += _rest_problems(record, path.name)
        problems += _operation_problems(record, path.name, period) if needs == "operations" else []
    if problems:
        raise InputError(problems)
    return without_offsets(to_record(columns, convention))


def _time_problems(columns: Columns) -> Iterator[str]:
    """Too few samples, or time steps that differ."""
    t, rows, file = columns.values["time"], columns.rows, columns.file
    if t.size < FEWEST_SAMPLES:
        yield f"{file}: {t.size} rows found, at least {FEWEST_SAMPLES} expected. Record more."
        return
    steps = np.diff(t)
    usual = float(np.median(steps))
    wrong = np.flatnonzero((np.abs(steps - usual) > JITTER * abs(usual)) | (steps <= 0.0))
    for k in wrong[:SHOWN]:
        yield (
            f"{file}, row {rows[k + 1]}: `time` is {t[k + 1]:.9g} s, {steps[k]:.6g} s after the row before; equal steps"
            f" of {usual:.6g} s are expected. Record with one sampling period, or resample."
        )
    if wrong.size > SHOWN:
        yield f"{file}: `time` has other steps in {wrong.size - SHOWN} more rows."


def _clipping(columns: Columns, name: str) -> Iterator[str]:
    """Flat ends of the range, where a converter saturates."""
    x, rows = columns.values[name], columns.rows
    unit = {"voltage": "V", "current": "A"}[name]
    for extreme, word in ((x.max(initial=0.0), "largest"), (x.min(initial=0.0), "smallest")):
        is_flat = x == extreme
        runs = [] if extreme == 0.0 else [run for run in true_runs(is_flat) if run[1] - run[0] >= CLIPPED]
        clipped = [run for run in runs if _is_noisy(x[~is_flat]) or (name == "current" and _is_steep(x, run[0]))]
        if clipped:
            first, end = clipped[0]
            yield (
                f"{columns.file}, row {rows[first]} to {rows[end - 1]}: `{name}` stays at its {word} value {extreme:g} "
                f"{unit}, in {len(clipped)} places: the signal is clipped. Widen the measuring range and record again."
            )


def _is_noisy(x: Vector) -> bool:
    """Noise of several digits, with which no stretch of equal samples is possible."""
    steps = np.diff(x)
    alternates = float(np.mean(steps[1:] * steps[:-1] < 0.0)) if steps.size > 1 else 0.0
    return alternates > 0.25 and noise(x) > 2.0 * resolution(x)


def _is_steep(x: Vector, first: int) -> bool:
    """True if the signal changes by more than a digit just before it becomes flat, where a settling one would not."""
    change = float(np.abs(np.diff(x[max(first - 2, 0) : first + 1])).max(initial=0.0))
    return change > STEEP * float(np.ptp(x)) and change > 2.0 * resolution(x)


def _largest_at_rest(record: Record) -> float:
    return REST * float(np.abs(record.current).max()) + SIGMAS * noise(record.current)


def _rest_problems(record: Record, file: str) -> Iterator[str]:
    """A record in which nothing operates, or whose first operation does not begin at rest."""
    found = starts(record)
    if not found:
        yield f"{file}: no current flows, so that nothing operates. Record at least one operation, from rest on."
        return
    i, limit = float(record.current[: found[0] + 1].mean()), _largest_at_rest(record)
    if abs(i) > limit:
        place = f"{file}, row {record.rows[0]} to {record.rows[found[0]]}"
        yield (
            f"{place}: `current` is {i:.4g} A before the first operation; at most {limit:.2g} A is expected. The flux "
            "linkage is an integral from rest on: record from rest, or cut the file to begin there."
        )


def _operation_problems(record: Record, file: str, period: float | None) -> Iterator[str]:
    """No complete operation, or operations that do not end as they began."""
    found = operations(record, period)
    if not found:
        rows = ", ".join(str(record.rows[k]) for k in starts(record)[: 2 * SHOWN]) or "none"
        yield (
            f"{file}: no complete operation (current begins to flow after row {rows}). Record until the current has "
            "ended, or give the length of a period with `--period` in s."
        )
    limit = 2.0 * _largest_at_rest(record)
    for operation in found[:SHOWN]:
        i = record.current[[operation.start, operation.stop]]
        if abs(i[1] - i[0]) > limit:
            place = f"{file}, row {record.rows[operation.start]} to {record.rows[operation.stop]}"
            yield (
                f"{place}: `current` is {i[0]:.4g} A at the start of this operation and {i[1]:.4g} A at its end;"
                " equal currents are expected for (23). Leave the voltage off for longer, or give the period with "
                "`--period` in s."
            )
