"""Read the sections of a scenario that name ports: connections, constant inputs, sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from gapsense.cosim.scenario import Connection, Port
from gapsense.files import read_columns
from gapsense.parameters import is_file, located
from gapsense.tables import LIST, NUMBER, TABLES, TEXT, Table, Value, flattened

Grid = dict[Port, tuple[Value, ...]]
Rows = tuple[dict[Port, Value], ...]
T = TypeVar("T")
ROWS = "rows"  # of `[sweep]`: a file, no parameter


def read_connections(table: Table) -> tuple[Connection, ...]:
    """Connections: those of `[connect]`, target = source, then those of `[[connections]]`, which may convert."""
    connect = table.table("connect")
    sources = by_port(connect, connect.flat(TEXT))
    ends = [(split(connect, str(target), source), target) for target, source in sources.items()]
    short = [Connection(source, target, place=connect.at(str(target))) for source, target in ends if source]
    items = table.take("connections", TABLES, [])
    long = [read_connection(table.child(item, f"connections[{index}]")) for index, item in enumerate(items)]
    return (*short, *(connection for connection in long if connection))


def read_connection(table: Table) -> Connection | None:
    """One connection of the long form, or None if it lacks an end."""
    names = {key: table.take(key, TEXT, required=True) for key in ("from", "to")}
    source, target = (None if name is None else split(table, key, name) for key, name in names.items())
    factor, bias, unit = table.take("factor", NUMBER), table.take("bias", NUMBER), table.take("unit", TEXT)
    table.finish()
    return Connection(source, target, factor, bias, unit, table.place) if source and target else None


def read_inputs(table: Table) -> dict[Port, float]:
    """Constant inputs; `"drive.enable" = 1.0` and `[inputs.drive] enable = 1.0` mean the same."""
    inputs = table.table("inputs")
    return {port: float(value) for port, value in by_port(inputs, inputs.flat(NUMBER)).items()}


def read_sweep(table: Table, folder: Path, files: list[Path]) -> tuple[Grid, Rows]:
    """Lists of values that a sweep goes through, by parameter, and values that belong together; notes their files."""
    sweep = table.table("sweep")
    file = sweep.take(ROWS, TEXT)
    lists = sweep.child({key: value for key, value in sweep.data.items() if key != ROWS}, "").flat(LIST)
    for name in [name for name, values in lists.items() if len(set(values)) < len(values)]:
        sweep.note(name, "the same value is given twice. Remove one.")
        del lists[name]
    grid = {n: tuple(located(n, value, folder, sweep) for value in values) for n, values in lists.items()}
    files += [Path(str(value)) for name, values in grid.items() for value in values if is_file(name, value)]
    if file is None:
        return by_port(sweep, grid), ()
    files.append(folder / file)
    return by_port(sweep, grid), read_rows(folder / file, sweep)


def read_rows(path: Path, sweep: Table) -> Rows:
    """Values that belong together, from a CSV file with a column per parameter and a row per run."""
    try:
        columns = read_columns(path)
    except (OSError, ValueError) as error:
        problem = f"{path}: there is no such file" if isinstance(error, OSError) else str(error).rstrip(".")
        sweep.note(ROWS, f"{problem}. A CSV file of numbers is expected, with a column per parameter. Correct it.")
        return ()
    twice = [name for name, _ in flattened(sweep.data) if name in columns]
    if twice:
        sweep.note(ROWS, f"`{twice[0]}` is given in {path.name} and in `[sweep]` too. Keep one.")
    if not any(column.size for column in columns.values()):
        sweep.note(ROWS, f"{path.name} has no rows. Add one per run.")
    ends = [split(sweep, ROWS, name) for name in columns]
    lines = zip(*(column.tolist() for column in columns.values()))
    return tuple({end: value for end, value in zip(ends, line) if end} for line in lines)


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
