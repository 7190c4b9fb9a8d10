"""Checks of a record before it is used; every message names rows and columns, and all of them come at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gapsense.problems import InputError
from gapsense.studies.identification.conventions import CONVENTIONS
from gapsense.studies.identification.flux import edges, operations
from gapsense.studies.identification.record import SHOWN, Columns, Record, Vector, read_columns, to_record

FEWEST_SAMPLES = 8
FEWEST_PERIODS = 2  # one alone cannot tell whether the record is periodic
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
    needs: str = "periods",
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
    needs: str = "periods",
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
        `periods`: complete periods from rest on, to identify from; `rest`: a start at rest, to simulate; `samples`:
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
        problems += _rest_problems(record, path.name)
        problems += _period_problems(record, path.name, period) if needs == "periods" else []
    if problems:
        raise InputError(problems)
    return to_record(columns, convention)


def noise(x: Vector) -> float:
    """Standard deviation of the noise of a signal, from its second differences; jumps do not count."""
    curvature = np.abs(np.diff(x, 2))
    return float(1.4826 * np.median(curvature) / np.sqrt(6.0)) if curvature.size else 0.0


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
        runs = [] if extreme == 0.0 else [run for run in _runs(is_flat) if run[1] - run[0] >= CLIPPED]
        clipped = [run for run in runs if _is_noisy(x[~is_flat]) or (name == "current" and _is_steep(x, run[0]))]
        if clipped:
            first, end = clipped[0]
            yield (
                f"{columns.file}, row {rows[first]} to {rows[end - 1]}: `{name}` stays at its {word} value {extreme:g} "
                f"{unit}, in {len(clipped)} places: the signal is clipped. Widen the measuring range and record again."
            )


def _runs(is_true: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Starts and ends of stretches that are true."""
    change = np.flatnonzero(np.diff(np.concatenate(([0], is_true.astype(int), [0]))))
    return list(zip(change[::2].tolist(), change[1::2].tolist()))


def _is_noisy(x: Vector) -> bool:
    """Noise of several digits, with which no stretch of equal samples is possible."""
    steps = np.diff(x)
    alternates = float(np.mean(steps[1:] * steps[:-1] < 0.0)) if steps.size > 1 else 0.0
    return alternates > 0.25 and noise(x) > 2.0 * _resolution(x)


def _is_steep(x: Vector, first: int) -> bool:
    """True if the signal changes by more than a digit just before it becomes flat, where a settling one would not."""
    change = float(np.abs(np.diff(x[max(first - 2, 0) : first + 1])).max(initial=0.0))
    return change > STEEP * float(np.ptp(x)) and change > 2.0 * _resolution(x)


def _resolution(x: Vector) -> float:
    """Smallest difference between two values."""
    return float(np.diff(np.unique(x)).min(initial=np.inf))


def _largest_at_rest(record: Record) -> float:
    return REST * float(np.abs(record.current).max()) + SIGMAS * noise(record.current)


def _rest_problems(record: Record, file: str) -> Iterator[str]:
    """A record whose first operation does not begin at rest."""
    starts = edges(record.voltage)
    if starts.size == 0 or record.voltage.max() <= 0.0:
        yield f"{file}: `voltage` has no rising edge, so that nothing operates. Record at least one, from rest on."
        return
    first = int(starts[0])
    i, limit = float(record.current[: first + 1].mean()), _largest_at_rest(record)
    if abs(i) > limit:
        place = f"{file}, row {record.rows[0]} to {record.rows[first]}"
        yield (
            f"{place}: `current` is {i:.4g} A before the voltage first rises; at most {limit:.2g} A is expected. The "
            "flux linkage is an integral from rest on: record from rest, or cut the file to begin there."
        )


def _period_problems(record: Record, file: str, period: float | None) -> Iterator[str]:
    """Too few operations, or operations that do not end as they began."""
    found = operations(record, period)
    if len(found) < FEWEST_PERIODS:
        rows = ", ".join(str(record.rows[k]) for k in edges(record.voltage)[: 2 * SHOWN]) or "none"
        yield (
            f"{file}: {len(found)} complete periods found (`voltage` rises after row {rows}), at least "
            f"{FEWEST_PERIODS} are expected for (23). Record longer, or give the period with `--period` in s."
        )
    limit = 2.0 * _largest_at_rest(record)
    for operation in found[:SHOWN]:
        i = record.current[[operation.start, operation.stop]]
        if abs(i[1] - i[0]) > limit:
            place = f"{file}, row {record.rows[operation.start]} to {record.rows[operation.stop]}"
            yield (
                f"{place}: `current` is {i[0]:.4g} A at the start of this period and {i[1]:.4g} A at its end;"
                " equal currents are expected for (23). Leave the voltage off for longer, or give the period with "
                "`--period` in s."
            )
