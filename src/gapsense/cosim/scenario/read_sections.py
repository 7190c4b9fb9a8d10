"""Read the sections of a scenario that name ports and signals: what is wired, swept, recorded and held against."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from gapsense._os.files import Sheet, number, read_sheet
from gapsense.cosim.events.event import SECTION
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.elements import Connection, Port
from gapsense.cosim.scenario.keys import BASELINE, CONNECTION, METRIC, RECORD, SWEEP, TOLERANCE
from gapsense.cosim.scenario.records import MOST_RUNS, Baseline, Metric, Record, RowsColumn, Tolerance, product
from gapsense.parameters import is_file, located
from gapsense.tables import LIST, SCALAR, TABLES, TEXT, Table, Value, flattened

Grid = dict[Port, tuple[Value, ...]]
Rows = tuple[dict[Port, Value], ...]
RowsColumns = dict[Port, RowsColumn]
T = TypeVar("T")
TRUTH = {"true": True, "false": False}
WHOLE = re.compile(r"[+-]?\d{1,15}")
EXPECTED = "A CSV file with a column per parameter is expected. Correct it."
ROWS = "rows"  # of `[sweep]`: a file, no parameter


def read_connections(table: Table) -> tuple[Connection, ...]:
    """Connections: those of `[connect]`, target = source, then those of `[[connections]]`."""
    connect = table.table("connect")
    sources = by_port(connect, connect.flat(TEXT))
    ends = [(split(connect, str(target), source), target) for target, source in sources.items()]
    short = [Connection(source, target, place=connect.at(str(target))) for source, target in ends if source]
    items = table.take("connections", TABLES, [])
    long = [read_connection(table.child(item, f"connections[{index}]")) for index, item in enumerate(items)]
    return (*short, *(connection for connection in long if connection))


def read_connection(table: Table) -> Connection | None:
    """One connection of the long form, or None if it lacks an end."""
    own = table.read(CONNECTION)
    source, target = (None if own[key] is None else split(table, key, own[key]) for key in ("from", "to"))
    how = (own["factor"], own["bias"], own["unit"], own["delayed"])
    return Connection(source, target, *how, place=table.place) if source and target else None


def read_sweep(table: Table, folder: Path, files: list[Path]) -> tuple[Grid, Rows, RowsColumns]:
    """Lists of values that a sweep goes through, by parameter, and values that belong together; notes their files."""
    sweep = table.table("sweep")
    file = sweep.read(SWEEP)[ROWS]
    lists = sweep.child({key: value for key, value in sweep.data.items() if key != ROWS}, "").flat(LIST)
    for name in [name for name, values in lists.items() if len(set(values)) < len(values)]:
        sweep.note(name, "the same value is given twice. Remove one.")
        del lists[name]
    grid = {n: tuple(located(n, value, folder, sweep) for value in values) for n, values in lists.items()}
    files += [Path(str(value)) for name, values in grid.items() for value in values if is_file(name, value)]
    rows, columns = Rows(), RowsColumns()
    if file is not None:
        files.append(folder / file)
        rows, columns = read_rows(folder / file, sweep, files, {SECTION, *table.table("components").data})
    sizes = [len(rows or ({},)), *map(len, grid.values())]
    if math.prod(sizes) > MOST_RUNS:
        sweep.note("", f"{product(sizes)} combinations found, at most {MOST_RUNS} expected. Shorten something.")
        grid = {}
    return by_port(sweep, grid), rows, columns


def read_rows(path: Path, sweep: Table, files: list[Path], components: Collection[str]) -> tuple[Rows, RowsColumns]:
    """Values that belong together, from a CSV file with a column per parameter and a row per run; notes their files.

    A file without the name of a component in its first line is something else: no message quotes it.
    """
    problems: list[str] = []
    try:
        sheet = read_sheet(path, problems)
    except OSError as error:
        sweep.note(ROWS, f"{path}: {error.strerror}. {EXPECTED}")
        return (), {}
    if not sheet.is_table and not any(name.partition(".")[0] in components for name in sheet.names):
        sweep.note(ROWS, f"{path}, line 1: no column is named after a parameter of a component. {EXPECTED}")
        return (), {}
    values = [
        [cell_value(sheet, i, j, problems, files) for j in range(len(sheet.names))] for i in range(len(sheet.rows))
    ]
    twice = [name for name, _ in flattened(sweep.data) if name in sheet.names]
    problems += [f"`{name}` is given in {path.name} and in `[sweep]` too. Keep one." for name in twice]
    problems += [] if values or problems else [f"{path.name} has no rows. Add one per run."]
    for problem in problems:
        sweep.note(ROWS, problem)
    ends = [split(sweep, ROWS, name) for name in sheet.names]
    lines = tuple(sheet.lines)
    columns = {end: RowsColumn(path.name, j, sheet.units[j - 1], lines) for j, end in enumerate(ends, 1) if end}
    return tuple({end: value for end, value in zip(ends, row) if end} for row in values), columns


def cell_value(sheet: Sheet, i: int, j: int, problems: list[str], files: list[Path]) -> Value:
    """Number, truth value or text of a cell, as in a list of `[sweep]`; a file is found from the sheet's folder on."""
    text = sheet.rows[i][j].strip()
    if text.lower() in TRUTH:
        return TRUTH[text.lower()]
    value = number(text)
    if value is not None and math.isfinite(value):
        return int(text) if WHOLE.fullmatch(text) else value
    if value is not None or not text:
        problems.append(f"{sheet.place(i, j)}: `{text}` found, {SCALAR.name} expected. Correct it.")
    if not is_file(sheet.names[j], text):
        return text
    file = (sheet.path.parent / text).resolve()
    if not file.is_file():
        problems.append(
            f"{sheet.place(i, j)}: there is no file `{file}`. Correct the path; it is relative to this file."
        )
    files.append(file)
    return str(file)


def by_port(table: Table, values: Mapping[str, T]) -> dict[Port, T]:
    """Values by port instead of by name; what names none is noted."""
    ends = {name: split(table, name, name) for name in values}
    return {end: values[name] for name, end in ends.items() if end}


def split(table: Table, key: str, name: str) -> Port | None:
    """`component.variable` cut at its first dot."""
    component, _, variable = name.partition(".")
    if component and variable:
        return Port(component, variable)
    table.note(key, f"`{name}` found, `component.variable` expected. Correct the name.")
    return None


def read_record(table: Table) -> Record:
    """Signals to record; all inputs and outputs if the section is missing."""
    record = table.table("record").read(RECORD)
    return Record(tuple(record["signals"]), record["decimation"])


def read_metrics(table: Table) -> tuple[Metric, ...]:
    """Metrics in the order of the file."""
    metrics = table.table("metrics")
    read = [read_metric(metrics.table(name), name) for name in metrics.data]
    return tuple(metric for metric in read if metric is not None)


def read_metric(table: Table, name: str) -> Metric | None:
    """One metric, or None if its kind or signal is missing."""
    own = table.read(METRIC)
    after, before, bounds = own["after"], own["before"], own["bounds"]
    if after is not None and before is not None and after >= before:
        table.note("", f"`after` is {after:.9g} s and `before` is {before:.9g} s. `after` must be the smaller one.")
    if own["kind"] is None or own["signal"] is None or not reference_fits(table, own["kind"], own["reference"]):
        return None
    span = None if bounds is None else (float(bounds[0]), float(bounds[1]))
    label = name if own["label"] is None else own["label"]
    return Metric(**{**own, "name": name, "bounds": span, "label": label})


def reference_fits(table: Table, kind: str, reference: str | float | None) -> bool:
    """True if a metric of this kind has the reference it needs, and none that it does not use."""
    use, given = KINDS[kind].reference, reference is not None
    if use == "axis" and not isinstance(reference, str):
        problem = f"`{kind}` needs the other signal of the curve. Name it."
    elif use == "required" and not given and "reference" not in table.data:
        problem = f"missing; `{kind}` compares with a signal, a parameter or a number. Add it."
    elif use == "none" and given:
        problem = f"`{kind}` uses no reference. Remove it."
    else:
        return True
    table.note("reference", problem)
    return False


def read_baseline(table: Table, path: Path, variant: str | None) -> Baseline:
    """Reference trajectory; a variant that names no file of its own has `baseline.<variant>.csv`.

    A section that names a file states that one; without a file it states one of each variant that is tested.
    """
    baseline = table.table("baseline")
    default = f"baseline.{variant}.csv" if variant else "baseline.csv"
    given = baseline.read(BASELINE)
    file = given["file"] or default
    own = table.data["variants"][variant].get("baseline") if variant else None
    if variant and not (isinstance(own, dict) and "file" in own):
        file = default
    tolerance = Tolerance(given["rtol"], given["atol"], given["edge_steps"])
    exceptions = baseline.table("tolerances")
    tolerances = {name: read_tolerance(exceptions.table(name), tolerance) for name in exceptions.data}
    chosen = None if given["signals"] is None else tuple(given["signals"])
    declared = "baseline" in table.data and (not variant or own is not None or given["file"] is None)
    return Baseline(
        file=path.parent / file,
        signals=chosen,
        tolerance=tolerance,
        tolerances=tolerances,
        declared=declared,
        decimation=given["decimation"],
    )


def read_tolerance(table: Table, default: Tolerance) -> Tolerance:
    """Tolerance of a table, each part by default that of the table around it."""
    own = {key: value for key, value in table.read(TOLERANCE).items() if value is not None}
    return replace(default, **own)
