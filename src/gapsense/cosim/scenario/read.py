"""Read a scenario file into records, noting every problem of the file and its parameter sets."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gapsense._os.files import SHOWN, Sheet, no_numbers, number, read_sheet, split_header
from gapsense._os.plain_files import LONGEST_NAME, unfit
from gapsense.cosim.events.event import SECTION, Event
from gapsense.cosim.events.read import read_events
from gapsense.cosim.scenario.document import OVER, Changes, Document, Source, read_document
from gapsense.cosim.scenario.elements import Component, Experiment, Port
from gapsense.cosim.scenario.input_signals import Played, Vector
from gapsense.cosim.scenario.keys import COMPONENT, EXPERIMENT, FILE, SIGNAL, VARIANT
from gapsense.cosim.scenario.read_sections import (
    Grid,
    Rows,
    RowsColumns,
    by_port,
    read_baseline,
    read_connections,
    read_metrics,
    read_record,
    read_sweep,
)
from gapsense.cosim.scenario.records import MOST_STEPS, NAME, Scenario
from gapsense.parameters import is_file, located_values, read_parameters
from gapsense.problems import ScenarioError, suggest
from gapsense.tables import INDEX, SCALAR, Table, Value, flattened

KEYS = tuple(key.name for key in SIGNAL.keys)
TIME = "time"
T = TypeVar("T")
LONGEST = 1e6  # wall time that is waited for [s], some days
COARSEST = 1e-3  # of a base step, between two numbers as large as its time
NO_EXPERIMENT = Experiment(0.0, 1.0, 1.0, 1)


@dataclass(frozen=True)
class Draft:
    """A scenario as far as it could be read, the problems met, and the sections they are in."""

    scenario: Scenario | None
    problems: list[str]
    broken: frozenset[str] = frozenset()


def load(source: Source, variant: str | None = None) -> Scenario:
    """Scenario of a file (or of `scenario.toml` in a folder), with one of its variants applied.

    Parameters
    ----------
    source : str, Path or Document
        Scenario file, its folder, or its content.
    variant : str, optional
        Name of a variant in the file.

    Returns
    -------
    Scenario

    Raises
    ------
    ScenarioError
        With all problems of the file and its parameter sets. The FMUs are not looked at: see `check`.
    """
    draft = read_draft(source, variant)
    if draft.problems or draft.scenario is None:
        raise ScenarioError(draft.problems)
    return draft.scenario


def read_draft(source: Source, variant: str | None = None) -> Draft:
    """Scenario as far as it can be read, with the problems found."""
    problems: list[str] = []
    document = read_document(source, problems)
    document = document and document.with_variant(variant, problems)
    if document is None:
        return Draft(None, problems)
    reader = Reader(document, variant, problems)
    return Draft(reader.scenario(), problems, frozenset(reader.broken))


class Reader:
    """Reads the sections of one scenario; `broken` holds the sections with problems."""

    def __init__(self, document: Document, variant: str | None, problems: list[str]) -> None:
        self.document, self.path, self.variant = document, document.path, variant
        self.table = Table(document.data, document.path.name, "", problems)
        self.changes = Changes(document.changes, problems)
        self.broken: set[str] = set()
        self.files: list[Path] = [self.path] if document.is_file else []

    def scenario(self) -> Scenario:
        """All sections, in the order in which the format describes them."""
        about, experiment = self.table.read(FILE), self.section("experiment", self.experiment)
        (inputs, played), seeds = self.section("inputs", self.inputs), self.section("seeds", self.seeds)
        components, events = self.section("components", self.components), self.section(SECTION, self.events)
        grid, rows, columns = self.section("sweep", self.sweep)
        self.changes.finish(components)
        return Scenario(
            path=self.path,
            called=self.document.name,
            title=about["title"] or "",
            description=about["description"],
            figure=about["figure"],
            variant=self.variant,
            experiment=experiment,
            components=components,
            connections=self.section("connections", read_connections),
            inputs=inputs,
            seeds=seeds,
            grid=grid,
            rows=rows,
            record=self.section("record", read_record),
            metrics=self.section("metrics", read_metrics),
            baseline=self.section("baseline", lambda table: read_baseline(table, self.path, self.variant)),
            variants=self.section("variants", self.variants),
            tested=self.tested(),
            files=tuple(dict.fromkeys(self.files)),
            rows_columns=columns,
            played=played,
            events=events,
            hashes=self.document.hashes,
            settings=self.document.changes,
        )

    def sweep(self, table: Table) -> tuple[Grid, Rows, RowsColumns]:
        """Values that a sweep goes through."""
        return read_sweep(table, self.path.parent, self.files)

    def events(self, table: Table) -> dict[str, Event]:
        """Events by name, with the values laid over them."""
        changes = {} if SECTION in table.table("components").data else self.changes.parameters(SECTION)
        return read_events(table, changes)

    def section(self, name: str, read: Callable[[Table], T]) -> T:
        """What `read` returns; the section counts as broken if it notes a problem."""
        before = len(self.table.problems)
        value = read(self.table)
        if len(self.table.problems) > before:
            self.broken.add(name)
        return value

    def experiment(self, table: Table) -> Experiment:
        """Time grid; a whole number of base steps must fit between start and stop."""
        table = table.table("experiment")
        given = table.read(EXPERIMENT)
        if given["stop"] is None or given["base_step"] is None:
            return NO_EXPERIMENT
        start, stop, base = (float(given[key]) for key in ("start", "stop", "base_step"))
        read = grid(table, start, stop, base, given["method"], given["pace"]) or NO_EXPERIMENT
        return replace(read, isolation=given["isolation"], step_limit=min(float(given["step_limit"]), LONGEST))

    def components(self, table: Table) -> dict[str, Component]:
        """Components by name, in the order of the file."""
        table = table.table("components")
        if not table.data:
            table.note("", "there is no component. Add a table `[components.<name>]`.")
        good = [name for name in table.data if re.fullmatch(NAME, name)]
        for name in [name for name in table.data if name not in good]:
            table.note(name, "a component's name is letters, digits and `_`, not starting with a digit. Rename it.")
        return {name: self.component(table.table(name), name) for name in good}

    def component(self, table: Table, name: str) -> Component:
        """One component with the values of its parameter sets; later sets win, `set` wins over all."""
        own = table.read(COMPONENT)
        files = [self.path.parent / file for file in own["parameters"]]
        sets = {path: read_parameters(path, table.problems) for path in files}
        inline = table.table("set")
        layers = [(path.name, sets[path]) for path in files]
        layers.append((inline.where(), located_values(inline, self.path.parent)))
        layers.append((OVER, self.changes.parameters(name)))
        given = [(place, name, value) for place, layer in layers for name, value in layer.items()]
        self.files += [*files, *(Path(str(value)) for _, name, value in given if is_file(name, value))]
        return Component(
            name=name,
            fmu=own["fmu"] or "",
            step=own["step"],
            offset=own["offset"],
            values={name: value for _, name, value in given},
            origin={name: place for place, name, _ in given},
            sets=sets,
            isolation=own["isolation"],
        )

    def seeds(self, table: Table) -> dict[str, int]:
        """Seed of each random component."""
        table = table.table("seeds")
        seeds = {name: table.take(name, INDEX, 0) for name in table.data}
        instead = self.changes.instead((f"{name}.seed" for name in seeds), INDEX)
        return {name: instead.get(f"{name}.seed", seed) for name, seed in seeds.items()}

    def inputs(self, table: Table) -> tuple[dict[Port, Value], dict[Port, Played]]:
        """Constants, and signals that inputs follow."""
        inputs, played = read_inputs(table, self.path.parent, self.files)
        instead = self.changes.instead(map(str, inputs), SCALAR)
        return {port: instead.get(str(port), value) for port, value in inputs.items()}, played

    def variants(self, table: Table) -> dict[str, str]:
        """Description of each variant; their content is read only when one is chosen."""
        table = table.table("variants")
        out: dict[str, str] = {}
        for name in table.data:
            item = table.table(name)
            if not re.fullmatch(NAME, name) or unfit(name):
                what = f"a variant's name is letters, digits and `_`, not starting with a digit, at most {LONGEST_NAME}"
                table.note(name[:LONGEST_NAME], f"{what}: files are named after it. Rename it.")
            out[name] = item.value(VARIANT.keys[0])
            if "variants" in item.data:
                item.note("variants", "a variant cannot contain variants. Write it beside the others.")
        return out

    def tested(self) -> tuple[str, ...]:
        """Variants with metrics or a baseline of their own."""
        data = self.table.data.get("variants", {})
        items = {k: v for k, v in data.items() if isinstance(v, dict)} if isinstance(data, dict) else {}
        folder = self.path.parent
        return tuple(
            name
            for name, item in items.items()
            if "metrics" in item or "baseline" in item or (folder / f"baseline.{name}.csv").is_file()
        )


def grid(table: Table, start: float, stop: float, base: float, method: str, pace: float | None) -> Experiment | None:
    """The time grid, or None if the run is not a whole number of base steps, or one that nobody waits for."""
    steps = (stop - start) / base
    said = f"the run from {start:.9g} s to {stop:.9g} s is {steps:.9g} steps of {base:.9g} s"
    if not abs(steps) <= MOST_STEPS:
        table.note("", f"{said}, at most {MOST_STEPS:.9g} expected. Change `stop` or `base_step`.")
        return None
    if math.ulp(max(abs(start), abs(stop))) > COARSEST * base:
        table.note(
            "", f"{said}, too small for numbers to tell its times apart. Start nearer to 0, or raise `base_step`."
        )
        return None
    if pace and (stop - start) / pace > LONGEST:
        table.note("pace", f"at {pace:.9g} the run takes {(stop - start) / pace:.9g} s. Raise it.")
    count = round(steps)
    slack = 1e-9 * base + 1e-15 * (abs(start) + abs(stop))
    if count >= 1 and abs(start + count * base - stop) <= slack:
        return Experiment(start=start, stop=stop, base_step=base, count=count, method=method, pace=pace)
    table.note("", f"{said}, a whole number of at least 1 expected. Change `stop` or `base_step`.")
    return None


# Read `[inputs]`: constants, and signals that inputs follow, from a CSV file or a table.


def read_inputs(table: Table, folder: Path, files: list[Path]) -> tuple[dict[Port, Value], dict[Port, Played]]:
    """Constants, `"drive.enable" = 1.0` or `[inputs.drive] enable = 1.0`, and signals; notes the files of these."""
    inputs = table.table("inputs")
    signals = dict(signal_tables(inputs.data))
    constants = inputs.child(without(inputs.data, signals), "").flat(SCALAR)
    read = {name: read_signal(inputs.child(data, name), folder, files) for name, data in signals.items()}
    return by_port(inputs, constants), by_port(inputs, {n: played for n, played in read.items() if played})


def signal_tables(data: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Tables that describe a signal, by the dotted name of the input."""
    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and "." in name and any(starts_signal(k, v) for k, v in value.items()):
            yield name, value
        elif isinstance(value, dict):
            yield from signal_tables(value, f"{name}.")


def starts_signal(key: str, value: Any) -> bool:
    """True for a key of a signal, perhaps misspelt: the value tells it from the rest of an input's name."""
    return isinstance(value, (str, list)) and bool(get_close_matches(key, KEYS, n=1))


def without(data: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """What is left without the tables of some dotted names, flat."""
    heads = tuple(f"{name}." for name in names)
    return {name: value for name, value in flattened(data) if not name.startswith(heads)}


def read_signal(table: Table, folder: Path, files: list[Path]) -> Played | None:
    """One signal, or None after noting why there is none."""
    own = table.read(SIGNAL)
    sources = [key for key in ("file", "times") if own[key] is not None]
    if len(sources) != 1:
        table.note("", "a signal has either `file` and `column` or `times` and `values`. Give one of the pairs.")
        return None
    first, second = ("file", "column") if sources == ["file"] else ("times", "values")
    for key in {"column", "values"} & set(table.data) - {second}:
        table.note(key, f"a signal with `{first}` has no `{key}`. Remove it.")
    if own[second] is None:
        table.note(second, f"missing; a signal with `{first}` needs it. Add it.")
        return None
    if first == "times":
        lines, unit, samples = None, "", tuple(np.array(own[key], dtype=np.float64) for key in ("times", "values"))
    else:
        files.append(folder / own["file"])
        column = read_column(folder / own["file"], own["column"], table)
        if column is None:
            return None
        lines, unit, samples = column
    return in_order(table, Played(samples[0], samples[1], own["interpolation"], unit), lines)


def in_order(table: Table, played: Played, lines: list[int] | None) -> Played | None:
    """The signal if its times rise, or None after noting where they do not."""
    times, values = played.times, played.values
    if times.size != values.size or times.size < 2:
        table.note("", f"{times.size} times and {values.size} values found, at least 2 of each expected. Correct it.")
        return None
    with np.errstate(over="ignore"):
        widths, heights = np.diff(times), np.diff(values)
    if not (np.isfinite(widths).all() and np.isfinite(heights).all()):
        table.note("", "the difference between two samples is too large for a number. Correct the values.")
        return None
    wrong = np.flatnonzero(widths <= 0.0) + 1
    for k in wrong[:SHOWN]:
        where = f"time {k + 1}" if lines is None else f"line {lines[k]}"
        table.note("", f"{where} is {times[k]:.9g} s after {times[k - 1]:.9g} s; times must rise. Correct it.")
    return None if wrong.size else played


def read_column(path: Path, column: str, table: Table) -> tuple[list[int], str, tuple[Vector, Vector]] | None:
    """Lines, unit and samples of a column of a CSV file, or None after noting what is wrong."""
    problems: list[str] = []
    try:
        sheet = read_sheet(path, problems)
    except OSError as error:
        table.note("file", f"`{path}` cannot be read: {error.strerror}. Correct the path.")
        return None
    places = [place_of(sheet, *split_header(name), problems) for name in (f"{TIME} [s]", column)]
    found = [k for k in places if k is not None]
    cells = [[(i, k, row[k]) for i, row in enumerate(sheet.rows)] for k in found]
    bad = [(sheet.place(i, k), text) for own in cells for i, k, text in own if not is_finite(text)]
    told = [f"{place}: `{text}` found, a finite number expected. Correct it." for place, text in bad[:SHOWN]]
    problems += told if sheet.is_table else no_numbers(sheet)
    for problem in problems:
        table.note("file", problem)
    if problems:
        return None
    times, values = (np.array([float(text) for *_, text in own], dtype=np.float64) for own in cells)
    return sheet.lines, sheet.units[found[1]], (times, values)


def place_of(sheet: Sheet, name: str, unit: str, problems: list[str]) -> int | None:
    """Where a column is, or None after noting that it is missing or in another unit."""
    if name not in sheet.names:
        problems.append(f"{sheet.path}, line 1: column `{name}` is missing. {suggest(name, sheet.known)}")
        return None
    place = sheet.names.index(name)
    if unit and sheet.units[place] not in ("", unit):
        said = f"{sheet.path}, line 1: `{name}` is in `{sheet.units[place]}`, `{unit}` is expected"
        problems.append(f"{said}, and nothing is converted. Convert the column or correct the unit.")
    return place


def is_finite(text: str) -> bool:
    """True for the text of a finite number."""
    value = number(text)
    return value is not None and math.isfinite(value)
