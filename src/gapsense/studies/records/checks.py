"""Records of files, checked before they are used; messages name rows and columns, and all of them come at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gapsense.problems import InputError
from gapsense.studies.records.conventions import AUTO, CONVENTIONS
from gapsense.studies.records.flux import estimate
from gapsense.studies.records.operations import SIGMAS, SMALL, Operation, noise, operations, starts
from gapsense.studies.records.reading import read_columns
from gapsense.studies.records.record import SHOWN, Columns, Reading, Record, to_record
from gapsense.studies.records.rest import unipolar, upright, without_offsets
from gapsense.studies.records.samples import clipping, evened, time_problems
from gapsense.studies.records.thin import shortened, thinned

LONGEST_RISE, LONGEST_STEP = 0.3, 0.02  # s; no short-stroke actuator is slower


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
    if separator == decimal:
        raise ValueError(f'--decimal: `{decimal}` also separates the cells. Give another `--separator`, such as ";".')
    return Reading(dict(pair.split("=", 1) for pair in column or []), convention, separator, decimal, may_clip)


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
    columns, said = evened(columns)
    whole = upright(to_record(columns, CONVENTIONS[0] if how.convention == AUTO else how.convention))
    record = without_offsets(whole)._replace(remarks=(*said, *whole.remarks, *unipolar(whole)))
    if needs != "samples":
        problems += rest_problems(record, path.name)
    if needs == "operations" and not problems:
        problems += operation_problems(record, path.name, period)
    if problems:
        raise InputError(problems)
    return record if needs == "samples" else shortened(thinned(record), period)


def _sample_problems(columns: Columns, how: Reading) -> Iterator[str]:
    """What is wrong with columns by themselves."""
    sound = [name for name, values in columns.values.items() if np.isfinite(values).all()]
    if "time" in sound:
        yield from time_problems(columns)
    for name in ("voltage", "current"):
        if name in sound and not how.may_clip:
            yield from clipping(columns, name)


def _largest_at_rest(record: Record) -> float:
    return SMALL["current"] * float(np.abs(record.current).max()) + SIGMAS * noise(record.current)


def begins_at_rest(record: Record) -> bool:
    """Whether no current flows before the first operation, of which there is one."""
    found = starts(record)
    return bool(found) and abs(float(record.current[: found[0] + 1].mean())) <= _largest_at_rest(record)


def rest_problems(record: Record, file: str) -> Iterator[str]:
    """A record in which nothing operates, or whose first operation does not begin at rest."""
    found = starts(record)
    if not found:
        yield f"{file}: no current flows, so that nothing operates. Record at least one operation, from rest on."
        return
    yield from _slow(record, file, found[0])
    i, limit = float(record.current[: found[0] + 1].mean()), _largest_at_rest(record)
    if not begins_at_rest(record):
        place = f"{file}, row {record.rows[0]} to {record.rows[found[0]]}"
        yield (
            f"{place}: `current` is {i:.4g} A before the first operation; at most {limit:.2g} A is expected. The flux "
            "linkage is an integral from rest on: record from rest, or cut the file to begin there; if the sensor shows"
            " this without current, subtract it."
        )


def operation_problems(record: Record, file: str, period: float | None) -> Iterator[str]:
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
    yield from _reversed(record, file, found)


def _slow(record: Record, file: str, start: int) -> Iterator[str]:
    """A current that takes seconds to rise: the times have another unit."""
    i = np.abs(record.current)
    rise = float(record.times[int(np.argmax(i > 0.5 * i.max()))] - record.times[start])
    if rise > LONGEST_RISE or record.dt > LONGEST_STEP:
        yield (
            f"{file}: `current` takes {rise:.3g} s to rise to half of its largest value, in steps of {record.dt:.3g} s;"
            " milliseconds are expected. If the times are in ms or us, write `time [ms]` or `time [us]` in the header."
        )


def _reversed(record: Record, file: str, found: Sequence[Operation]) -> Iterator[str]:
    """Voltage and current of opposite signs, or no voltage."""
    if found and not np.ptp(record.voltage):
        yield f"{file}: `voltage` is the same throughout though current flows. Record the voltage at the coil."
    elif found and (R := float(np.median(estimate(record, list(found)).resistances))) <= 0.0:
        yield (
            f"{file}: voltage and current have opposite signs, so that the resistance would be {R:.3g} Ohm. One of the"
            " sensors is reversed: change the sign of a column."
        )
