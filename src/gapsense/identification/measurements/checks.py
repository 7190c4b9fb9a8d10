"""Records of files, checked before they are used; messages name rows and columns, and all of them come at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gapsense.identification.measurements.conventions import AUTO, CONVENTIONS
from gapsense.identification.measurements.reading import read_columns
from gapsense.identification.measurements.record import Columns, Reading, Record, to_record
from gapsense.identification.measurements.refusals import operation_problems, rest_problems
from gapsense.identification.measurements.rest import unipolar, upright, without_offsets
from gapsense.identification.measurements.samples import clipping, evened, time_problems
from gapsense.identification.measurements.thin import shortened, thinned
from gapsense.problems import InputError


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
