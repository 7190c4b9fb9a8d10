"""Read a scenario, a file or the same tables made by a program, into records; every problem of it is noted."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from shlex import quote
from typing import Any, TypeVar

import numpy as np

from gapsense._os.files import (
    LONGEST_NAME,
    SHOWN,
    Sheet,
    facts_beside,
    finite,
    no_numbers,
    number,
    read_sheet,
    split_header,
    unfit,
)
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.keys import SECTIONS
from gapsense.cosim.scenario.records import (
    ACTIONS,
    INTERPOLATIONS,
    ITERATIVE,
    MOST_RUNS,
    MOST_STEPS,
    NAME,
    NEEDED,
    SECTION,
    Baseline,
    Component,
    Connection,
    Event,
    Experiment,
    Metric,
    Page,
    Played,
    Port,
    Record,
    RowsColumn,
    Scenario,
    Tolerance,
    Vector,
    When,
    product,
)
from gapsense.parameters import is_file, locate_file, located_values, read_parameters
from gapsense.problems import ScenarioError, suggest
from gapsense.shipped import example, examples
from gapsense.tables import (
    INDEX,
    LIST,
    SCALAR,
    TABLES,
    TEXT,
    Kind,
    Table,
    Value,
    flatten_table,
    merge_tables,
    parsed_value,
    read_toml,
)

CAMPAIGN_FILE = "campaign.sqlite"
SCENARIO, STUDY, RESULT, RECORD, REPORTED, CAMPAIGN = "scenario", "study", "result", "record", "reported", "campaign"
TAKEN = {  # kinds that are accepted, by what is expected
    SCENARIO: ("scenario",),
    STUDY: ("study",),
    RESULT: ("result", "table"),
    RECORD: ("result", "table"),
    REPORTED: ("result", "table", "sweep", "campaign"),
    CAMPAIGN: ("campaign",),
}
CAMPAIGNS = "gapsense campaign show {%s}` or `gapsense report {%s}"
WORDS = {  # what it is, and what to do
    "campaign": ("the folder of a campaign's result", f"Look at it with `{CAMPAIGNS % ('path', 'path')}`"),
    "store": ("a file of a campaign's result", f"Name its folder: `{CAMPAIGNS % ('folder', 'folder')}`"),
    "ledger": ("what a sweep continues from", "Name the table beside it: `gapsense report {table}`"),
    "sweep": ("the table of a sweep", "Look at it with `gapsense report {path}`"),
    "sidecar": ("the side-car of a result", "Name the CSV file beside it, `{table}`"),
    "result": ("the result of a run", "Look at it with `gapsense figure {path}` or `gapsense report {path}`"),
    "table": ("a CSV file", "If it is a record of measurements, try `gapsense inspect {path}`"),
    "fmu": ("an FMU", "Look at its ports with `gapsense info {path}`"),
    "checkpoint": ("the checkpoint of a run", "`gapsense run SCENARIO --resume` continues from it"),
    "study": ("the study of a campaign", "Run it with `gapsense campaign {path}`"),
    "scenario": ("a scenario", "Run it with `gapsense run {path}`"),
    "picture": ("a picture or a page", "Name what it was made of"),
    "parquet": ("a Parquet file", "Name a CSV file, or the folder of a campaign"),
    "json": ("a JSON file", "Name a CSV file, or the folder of a campaign"),
}
ENDINGS = {
    ".fmu": "fmu",
    ".checkpoint": "checkpoint",
    ".parquet": "parquet",
    **dict.fromkeys((".png", ".pdf", ".svg", ".html"), "picture"),
}


def other_kind(path: Path, expected: str) -> str:
    """Sentence on what is there if that is surely not what is expected, with the command that is right for it."""
    kind = kind_of(path)
    if not kind or kind in TAKEN[expected]:
        return ""
    what, remedy = WORDS[kind]
    places = {"path": path, "folder": path.parent, "table": path.with_suffix(".csv")}
    named = {name: quote(str(place)) for name, place in places.items()}  # commands are to be copied
    return f"`{path}`: it is {what}. {remedy.format(**named)}."


def kind_of(path: Path) -> str:
    """Kind of a file or folder, by its name and by what stands beside it; nothing if it may be anything."""
    ending = path.suffix.lower()
    if path.is_dir():
        return "campaign" if (path / CAMPAIGN_FILE).is_file() else ""
    if not path.is_file():
        return ""
    if ending == ".sqlite":
        return "store" if path.name == CAMPAIGN_FILE else "ledger"
    if ending == ".csv":
        return {"result": "result", "sweep": "sweep"}.get(format_of(path.with_suffix(".json")), "table")
    if ending == ".json":
        return {"result": "sidecar", "sweep": "sidecar", "campaign": "json"}.get(format_of(path), "json")
    if ending == ".toml":
        data = read_toml(path, []) or {}
        return "scenario" if "components" in data else "study" if isinstance(data.get("scenario"), str) else ""
    return ENDINGS.get(ending, "")


def format_of(file: Path) -> str:
    """What a JSON file of ours is of: a result, a sweep, a campaign; nothing for another file."""
    words = str(facts_beside(file).get("format", "")).split()
    return words[1] if len(words) == 3 and words[0] == "gapsense" else ""


# What a scenario says before it is read: a file, or the same tables made by a program, and values laid over it.


OVER = "--set"  # on the command line, and as the place of a value in messages


@dataclass(frozen=True)
class Document:
    """Tables of a scenario; `path` is its file, or, of one that has none, its name in the folder of its other files."""

    path: Path
    data: Mapping[str, Any]
    changes: Mapping[str, Any] = field(default_factory=dict)  # values by `component.variable`, over all others
    is_file: bool = False  # as it stands in `path`
    problems: Sequence[str] = ()  # of the changes; told with those of the file

    @property
    def name(self) -> str:
        """Name of the scenario: that of its file's folder, or its own."""
        path = self.path.resolve()
        return path.parent.name if self.is_file or path.suffix == ".toml" else path.name

    @property
    def hashes(self) -> dict[str, str]:
        """Hashes of what stands in no file."""
        parts = {"changes": self.changes, "content": {} if self.is_file else self.data}
        return {
            part: hashlib.sha256(json.dumps(tables).encode()).hexdigest() for part, tables in parts.items() if tables
        }

    def with_variant(self, variant: str | None, problems: list[str]) -> Document | None:
        """The document with one of its variants laid over it, or None after noting that there is none."""
        if variant is None:
            return self
        variants = self.data.get("variants")
        if not isinstance(variants, dict) or not isinstance(variants.get(variant), dict):
            known = variants if isinstance(variants, dict) else {}
            problems.append(f"{self.path.name}: there is no variant `{variant}`. {suggest(variant, known)}")
            return None
        base = {key: value for key, value in self.data.items() if key != "variants"}
        return replace(self, data=merge_tables(base, variants[variant]) | {"variants": variants})


Source = str | Path | Document  # of a scenario: its file or folder, or its content


def scenario_file(source: Source) -> Path:
    """The scenario file itself, also if its folder, its content, or the name of an example is given.

    An example counts where there is no such file.
    """
    if isinstance(source, Document):
        return source.path
    path = Path(source)
    file = path / "scenario.toml" if path.is_dir() else path
    folder = None if file.exists() else example(path)
    return folder / "scenario.toml" if folder else file


def missing(path: Path) -> str:
    """Sentence on a scenario that there is not, with one that was perhaps meant, or what its folder is."""
    folder = path.parent
    if path.name == "scenario.toml" and (wrong := other_kind(folder, SCENARIO)):
        return wrong
    beside = [file.name for file in folder.glob("*.toml")]
    around = [file.parent.name for file in folder.glob("*/scenario.toml")] + (examples() if folder == Path() else [])
    near = get_close_matches(path.name, sorted({*beside, *around}), n=1)
    hint = f"Did you mean `{folder / near[0]}`?" if near else "Correct the path."
    return f"{path}: there is no such file. {hint}"


def read_document(source: Source, problems: list[str]) -> Document | None:
    """Content of a scenario file, or None after noting why it cannot be read."""
    if isinstance(source, Document):
        problems += source.problems
        return source
    path = scenario_file(source)
    if wrong := other_kind(path, SCENARIO) if path.exists() else missing(path):
        problems.append(wrong)
        return None
    data = read_toml(path, problems)
    return None if data is None else Document(path, data, is_file=True)


def document_of(source: Source, variant: str | None = None) -> Document:
    """Content of a scenario with one of its variants laid over it; a ScenarioError says why it cannot be read."""
    problems: list[str] = []
    document = read_document(source, problems)
    document = document and document.with_variant(variant, problems)
    if problems or document is None:
        raise ScenarioError(problems)
    return document


# Values laid over a scenario from outside: `--set component.variable=value`.


def changed(source: Source, settings: Sequence[str]) -> Source:
    """Lay values over a scenario that are written as on the command line: `valve.damping=0.4`.

    What TOML does not take as a value is a text; files are relative to the working folder. What is wrong is told with
    what is wrong with the file, when it is checked or run.
    """
    if not settings:
        return source
    unread: list[str] = []
    if (document := read_document(source, unread)) is None:
        raise ScenarioError(unread)
    problems: list[str] = []
    changes = read_settings(settings, "component.parameter", problems)
    return replace(document, changes={**document.changes, **changes}, problems=(*document.problems, *problems))


def read_settings(settings: Sequence[str], form: str, problems: list[str]) -> dict[str, Value]:
    """Values of `name=value` texts by their names, which have a dot where the `form` of a name has one."""
    values: dict[str, Value] = {}
    for setting in settings:
        name, equals, text = (part.strip() for part in setting.partition("="))
        if not (equals and all(name.partition(".") if "." in form else [name])):
            problems.append(f"{OVER}, {setting}: `{form}=value` expected. Correct it.")
        elif name in values:
            problems.append(f"{OVER}, {name}: given twice. Keep one.")
        else:
            values[name] = parsed_value(text)
    return values


class Changes:
    """Values laid over a scenario: first come those of inputs and seeds that it states, the others are parameters."""

    def __init__(self, given: Mapping[str, Any], problems: list[str]) -> None:
        self.left = dict(given)
        self.table = Table(given, OVER, "", problems)

    def take_values(self, names: Iterable[str], kind: Kind) -> dict[str, Any]:
        """Take values of that kind for what the scenario states under these names."""
        return self.pop_values([name for name in names if name in self.left]).flat(kind)

    def parameters(self, component: str) -> dict[str, Value]:
        """Values for the parameters of a component."""
        head = f"{component}."
        mine = self.pop_values([name for name in self.left if name.startswith(head)])
        return {name.removeprefix(head): value for name, value in located_values(mine, Path()).items()}

    def pop_values(self, names: Iterable[str]) -> Table:
        """Take values out, so that nobody else gets them."""
        return self.table.child({name: self.left.pop(name) for name in names}, "")

    def finish(self, components: Iterable[str]) -> None:
        """Note what names no component."""
        for name in self.left:
            component = name.partition(".")[0]
            self.table.note(name, f"there is no component `{component}`. {suggest(component, components)}")


# Read a scenario file into records, noting every problem of the file and its parameter sets.


KEYS = tuple(key.name for key in SECTIONS["signal"].keys)
TIME = "time"
T = TypeVar("T")
LONGEST = 1e6  # wall time that is waited for [s], some days
COARSEST = 1e-3  # of a base step, between two numbers as large as its time
CONTROL = ("step_control", "shortest_step", "longest_step")
NO_EXPERIMENT = Experiment(0.0, 1.0, 1.0, 1)


@dataclass(frozen=True)
class Draft:
    """A scenario as far as it could be read, the problems met, and the sections they are in."""

    scenario: Scenario | None
    problems: list[str]
    broken: frozenset[str] = frozenset()


def load(source: Source, variant: str | None = None) -> Scenario:
    """Scenario of a file, of `scenario.toml` in a folder, or of its content, with one of its variants applied.

    A ScenarioError has all problems of the file and its parameter sets. The FMUs are not looked at: see `check`.
    """
    draft = read_draft(source, variant)
    if draft.problems or draft.scenario is None:
        raise ScenarioError(draft.problems)
    return draft.scenario


def read_draft(source: Source, variant: str | None = None) -> Draft:
    """Scenario as far as it can be read, with the problems found."""
    problems: list[str] = []
    if (document := read_document(source, problems)) is None:
        return Draft(None, problems)
    laid = document.with_variant(variant, problems)
    reader = ScenarioReader(laid or document, variant if laid else None, problems)
    return Draft(reader.scenario(), problems, frozenset(reader.broken))


class ScenarioReader:
    """Reads the sections of one scenario; `broken` holds the sections with problems."""

    def __init__(self, document: Document, variant: str | None, problems: list[str]) -> None:
        self.document, self.path, self.variant = document, document.path, variant
        self.table = Table(document.data, document.path.name, "", problems)
        self.changes = Changes(document.changes, problems)
        self.broken: set[str] = set()
        self.files: list[Path] = [self.path] if document.is_file else []

    def scenario(self) -> Scenario:
        """All sections, in the order in which the format describes them."""
        about, experiment = self.table.read(SECTIONS["file"]), self.section("experiment", self.experiment)
        (inputs, played), seeds = self.section("inputs", self.inputs), self.section("seeds", self.seeds)
        components, events = self.section("components", self.components), self.section(SECTION, self.events)
        grid, rows, columns = self.section("sweep", lambda table: read_sweep(table, self.path.parent, self.files))
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
            tested=self.find_tested(),
            files=tuple(dict.fromkeys(self.files)),
            rows_columns=columns,
            played=played,
            events=events,
            page=self.section("page", read_page),
            hashes=self.document.hashes,
            settings=self.document.changes,
        )

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
        given = table.read(SECTIONS["experiment"])
        if given["stop"] is None or given["base_step"] is None:
            return NO_EXPERIMENT
        start, stop, base = (float(given[key]) for key in ("start", "stop", "base_step"))
        read = grid(table, start, stop, base, given["method"], given["pace"]) or NO_EXPERIMENT
        own = {key: given[key] for key in ("isolation", "loop_tolerance", "loop_evaluations", "inputs", *CONTROL)}
        own["inputs"] = own["inputs"] or INTERPOLATIONS[given["method"] != ITERATIVE]
        if own["longest_step"] and own["longest_step"] < own["shortest_step"]:
            found = f"{own['longest_step']} found, at least `shortest_step` = {own['shortest_step']} expected"
            table.note("longest_step", f"{found}. Correct one of them.")
        if own["step_control"] is None:
            for key in [key for key in CONTROL if key in table.data]:
                table.note(key, "it is for steps that are controlled. Give `step_control`, or remove it.")
        return replace(read, **own, step_limit=min(float(given["step_limit"]), LONGEST))

    def components(self, table: Table) -> dict[str, Component]:
        """Components by name, in the order of the file."""
        table = table.table("components")
        if not table.data:
            table.note("", "there is no component. Add a table `[components.<name>]`.")
        good = [name for name in table.data if re.fullmatch(NAME, name)]
        for name in [name for name in table.data if name not in good]:
            table.note(name, "a component's name is letters, digits and `_`, not starting with a digit. Rename it.")
        for name in [name for name in good if isinstance(table.data[name], dict) and "fmu" not in table.data[name]]:
            others = [other for other in good if other != name]
            if near := get_close_matches(name, others, n=1):  # a slip in a variant makes a component
                table.note(name, f"there is nothing of it but this. Did you mean `{near[0]}`?")
        return {name: self.component(table.table(name), name) for name in good}

    def component(self, table: Table, name: str) -> Component:
        """One component with the values of its parameter sets; later sets win, `set` wins over all."""
        own = table.read(SECTIONS["component"])
        files = [self.path.parent / file for file in own["parameters"]]
        sets = {path: read_parameters(path, table.problems) for path in files}
        inline = table.table("set")
        layers = [(path.name, sets[path]) for path in files]
        layers += [(inline.where(), located_values(inline, self.path.parent)), (OVER, self.changes.parameters(name))]
        given = [(place, name, value) for place, layer in layers for name, value in layer.items()]
        firmware = (self.path.parent / own["firmware"]).resolve() if own["firmware"] else None
        self.files += [firmware] if firmware and firmware.is_file() else []
        self.files += [*files, *(Path(str(value)) for _, name, value in given if is_file(name, value))]
        return Component(
            name=name,
            fmu=own["fmu"] or "",
            step=own["step"],
            offset=own["offset"],
            edge=own["edge"] or "",
            values={name: value for _, name, value in given},
            origin={name: place for place, name, _ in given},
            sets=sets,
            isolation=own["isolation"],
            board=own["board"] or "",
            firmware=firmware,
            clock=own["clock"],
        )

    def seeds(self, table: Table) -> dict[str, int]:
        """Seed of each random component."""
        table = table.table("seeds")
        seeds = {name: table.take(name, INDEX, 0) for name in table.data}
        instead = self.changes.take_values((f"{name}.seed" for name in seeds), INDEX)
        return {name: instead.get(f"{name}.seed", seed) for name, seed in seeds.items()}

    def inputs(self, table: Table) -> tuple[dict[Port, Value], dict[Port, Played]]:
        """Constants, `"drive.enable" = 1.0` or `[inputs.drive] enable = 1.0`, and signals that inputs follow."""
        table = table.table("inputs")
        signals = dict(signal_tables(table.data))
        heads = tuple(f"{name}." for name in signals)
        plain = {name: value for name, value in flatten_table(table.data) if not name.startswith(heads)}
        constants = table.child(plain, "").flat(SCALAR)
        read = {n: read_signal(table.child(data, n), self.path.parent, self.files) for n, data in signals.items()}
        inputs = by_port(table, constants)
        instead = self.changes.take_values(map(str, inputs), SCALAR)
        played = by_port(table, {name: signal for name, signal in read.items() if signal})
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
            out[name] = item.value(SECTIONS["variant"].keys[0])
            if "variants" in item.data:
                item.note("variants", "a variant cannot contain variants. Write it beside the others.")
        return out

    def find_tested(self) -> tuple[str, ...]:
        """Find variants with metrics or a baseline of their own."""
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


def signal_tables(data: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Tables that describe a signal, by the dotted name of the input."""

    def starts(key: str, value: Any) -> bool:
        """True for a key of a signal, perhaps misspelt: the value tells it from the rest of an input's name."""
        return isinstance(value, (str, list)) and bool(get_close_matches(key, KEYS, n=1))

    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and "." in name and any(starts(*item) for item in value.items()):
            yield name, value
        elif isinstance(value, dict):
            yield from signal_tables(value, f"{name}.")


def read_signal(table: Table, folder: Path, files: list[Path]) -> Played | None:
    """One signal, or None after noting why there is none."""
    own = table.read(SECTIONS["signal"])
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
        if (column := read_column(folder / own["file"], own["column"], table)) is None:
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
    bad = [(sheet.place(i, k), text) for own in cells for i, k, text in own if finite(text) is None]
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


# Read the sections of a scenario that name ports and signals: what is wired, swept, recorded and held against.


Grid = dict[Port, tuple[Value, ...]]
Rows = tuple[dict[Port, Value], ...]
RowsColumns = dict[Port, RowsColumn]
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
    own = table.read(SECTIONS["connection"])
    source, target = (None if own[key] is None else split(table, key, own[key]) for key in ("from", "to"))
    how = (own["factor"], own["bias"], own["unit"], own["delayed"], own["mean"])
    return Connection(source, target, *how, place=table.place) if source and target else None


def read_sweep(table: Table, folder: Path, files: list[Path]) -> tuple[Grid, Rows, RowsColumns]:
    """Lists of values that a sweep goes through, by parameter, and values that belong together; notes their files."""
    sweep = table.table("sweep")
    file = sweep.read(SECTIONS["sweep"])[ROWS]
    grid = read_lists(sweep.child({key: value for key, value in sweep.data.items() if key != ROWS}, ""), folder, files)
    rows, columns = Rows(), RowsColumns()
    if file is not None:
        files.append(folder / file)
        rows, columns = read_rows(folder / file, sweep, files, {SECTION, *table.table("components").data})
    sizes = [len(rows or ({},)), *map(len, grid.values())]
    if math.prod(sizes) > MOST_RUNS:
        sweep.note("", f"{product(sizes)} combinations found, at most {MOST_RUNS} expected. Shorten something.")
        grid = {}
    return grid, rows, columns


def read_lists(table: Table, folder: Path, files: list[Path]) -> Grid:
    """Lists of values by parameter; one with a value twice is noted and left out. Notes the files that they name."""
    lists = table.flat(LIST)
    for name in [name for name, values in lists.items() if len(set(values)) < len(values)]:
        table.note(name, "the same value is given twice. Remove one.")
        del lists[name]
    grid = {n: tuple(locate_file(n, value, folder, table) for value in values) for n, values in lists.items()}
    files += [Path(str(value)) for name, values in grid.items() for value in values if is_file(name, value)]
    return by_port(table, grid)


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
    twice = [name for name, _ in flatten_table(sweep.data) if name in sheet.names]
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
    if (value := finite(text)) is not None:
        return int(text) if WHOLE.fullmatch(text) else value
    if not text or number(text) is not None:
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
    record = table.table("record").read(SECTIONS["recording"])
    return Record(tuple(record["signals"]), record["decimation"])


def read_page(table: Table) -> Page:
    """What a page offers and shows first."""
    page = table.table("page").read(SECTIONS["page"])
    return Page(tuple(page["controls"] or ()), tuple(page["first"] or ()))


def read_metrics(table: Table) -> tuple[Metric, ...]:
    """Metrics in the order of the file."""
    metrics = table.table("metrics")
    read = [read_metric(metrics.table(name), name) for name in metrics.data]
    return tuple(metric for metric in read if metric is not None)


def read_metric(table: Table, name: str) -> Metric | None:
    """One metric, or None if its kind or signal is missing."""
    own = table.read(SECTIONS["metric"])
    after, before, bounds = own["after"], own["before"], own["bounds"]
    if after is not None and before is not None and after >= before:
        table.note("", f"`after` is {after:.9g} s and `before` is {before:.9g} s. `after` must be the smaller one.")
    if own["kind"] is None or own["signal"] is None or not reference_fits(table, own["kind"], own["reference"]):
        return None
    count, expected = len(own["flows"] or ()), 2 if KINDS[own["kind"]].takes_flows else 0
    if count != expected:
        table.note("flows", f"{count} signals found, {expected} expected for `{own['kind']}`. Correct the list.")
        return None
    own["flows"] = tuple(own["flows"]) if own["flows"] else None
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
    given = baseline.read(SECTIONS["baseline"])
    file = given["file"] or default
    own = table.data["variants"][variant].get("baseline") if variant else None
    if variant and not (isinstance(own, dict) and "file" in own):
        file = default
    tolerance = Tolerance(given["rtol"], given["atol"], given["edge_steps"])
    exceptions = baseline.table("tolerances")
    own_keys = {name: exceptions.table(name).read(SECTIONS["tolerance"]) for name in exceptions.data}
    tolerances = {
        name: replace(tolerance, **{key: value for key, value in keys.items() if value is not None})
        for name, keys in own_keys.items()
    }
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


# Read `[events]`, from a file or with the values that a sweep or `--set` lays over it.


Events = Mapping[str, Event]


def read_events(table: Table, changes: Mapping[str, Any]) -> dict[str, Event]:
    """Events in the order of the file; `changes` are values of their keys by `event.key`."""
    events = table.table(SECTION)
    good = [name for name in events.data if re.fullmatch(NAME, name)]
    for name in [name for name in events.data if name not in good]:
        events.note(name, "an event's name is letters, digits and `_`, not starting with a digit. Rename it.")
    read = {name: read_event(events.table(name), name, changes) for name in good}
    for name in [name for name in changes if name.partition(".")[0] not in good]:
        event = name.partition(".")[0]
        events.note(name, f"there is no event `{event}`. {suggest(event, good)}")
    return {name: event for name, event in read.items() if event}


def read_event(table: Table, name: str, changes: Mapping[str, Any]) -> Event | None:
    """One event, or None after noting why there is none; `changes` are values by `event.key`."""
    head = f"{name}."
    if own := {key.removeprefix(head): value for key, value in changes.items() if key.startswith(head)}:
        flat = {**dict(flatten_table(table.data)), **own}
        inner = {key.removeprefix("when."): value for key, value in flat.items() if key.startswith("when.")}
        outer = {key: value for key, value in flat.items() if "." not in key}
        table = table.child({**outer, **({"when": inner} if inner else {})}, "")
    before, given = len(table.problems), table.read(SECTIONS["event"])
    when = read_when(table.table("when")) if "when" in table.data else None
    target = None if given["target"] is None else split(table, "target", given["target"])
    note_actions(table, given)
    note_times(table, given)
    if target is None or given["action"] is None or len(table.problems) > before:
        return None
    times = {key: (None if given[key] is None else float(given[key])) for key in ("over", "at", "until", "duration")}
    return Event(name=name, **{**given, **times, "target": target, "when": when, "given": dict(table.data)})


def read_when(table: Table) -> When | None:
    """A condition, or None after noting why there is none."""
    given = table.read(SECTIONS["when"])
    signal = None if given["signal"] is None else split(table, "signal", given["signal"])
    side = one_of(table, "above", "below")
    if signal is None or side is None or given[side] is None:
        return None
    return When(
        signal=signal,
        level=float(given[side]),
        is_above=side == "above",
        lasting=given["for"] or 0.0,
        after=given["after"],
        again=given["again"],
    )


def one_of(table: Table, *keys: str) -> str | None:
    """The one of two keys that a table has, or None after noting that it has neither, or both."""
    given = [key for key in keys if key in table.data]
    if len(given) == 1:
        return given[0]
    expected = " or ".join(f"`{key}`" for key in keys)
    table.note("", f"{'both' if given else 'neither'} found, either {expected} expected. Give one of them.")
    return None


def note_actions(table: Table, given: Mapping[str, Any]) -> None:
    """Note a value, a time or a seed that the action needs or does not use."""
    if (name := given["action"]) is None:
        return
    action = ACTIONS[name]
    if action.value and "value" not in table.data:
        table.note("value", f"missing; `{name}` needs {action.value}. Add it.")
    if not action.value and "value" in table.data:
        table.note("value", f"`{name}` has no value. Remove it.")
    elif name != "set" and isinstance(given["value"], (str, bool)):
        table.note("value", f"{given['value']!r} found, `{name}` needs a number. Correct it.")
    elif name == "noise" and (given["value"] or 0.0) < 0.0:
        table.note("value", f"{given['value']} found, a standard deviation cannot be negative. Correct it.")
    if action.over == NEEDED and "over" not in table.data:
        table.note("over", f"missing; `{name}` needs its duration [s]. Add it.")
    if not action.over and "over" in table.data:
        table.note("over", f"`{name}` begins at once. Remove it, or use `ramp`.")
    if name != "noise" and "seed" in table.data:
        table.note("seed", f"`{name}` is not random. Remove it.")


def note_times(table: Table, given: Mapping[str, Any]) -> None:
    """Note times that are missing or contradict each other."""
    at, until = given["at"], given["until"]
    one_of(table, "at", "when")
    if "until" in table.data and "duration" in table.data:
        table.note("duration", "`until` gives the end too. Keep one.")
    if "until" in table.data and "when" in table.data:
        table.note("until", "an event with `when` lasts for a `duration`, or to the end of the run. Use that.")
    if at is not None and until is not None and at >= until:
        table.note("until", f"`at` is {at:.9g} s and `until` is {until:.9g} s. `at` must be the smaller one.")
    again = isinstance(table.data.get("when"), dict) and table.data["when"].get("again") is True
    if again and "duration" not in table.data:
        table.note("when.again", "an event that lasts to the end of the run happens once. Add `duration`.")


def vary_events(events: Events, values: Mapping[Port, Value], problems: list[str]) -> Events:
    """Give events the values that a sweep has for their keys; what is wrong with these is noted."""
    changes = {port.variable: value for port, value in values.items() if port.component == SECTION}
    if not changes:
        return events
    table = Table({SECTION: {name: event.given for name, event in events.items()}}, "sweep", "", problems)
    return read_events(table, changes)
