"""Read a scenario file into records, noting every problem of the file and its parameter sets."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from gapsense.cosim import load_sections as sections
from gapsense.cosim.scenario import ISOLATIONS, METHODS, STEP_LIMIT, Component, Experiment, Scenario
from gapsense.parameters import is_file, located_values, read_parameters
from gapsense.problems import ScenarioError, suggest
from gapsense.tables import COUNT, INDEX, NUMBER, POSITIVE, TEXT, TEXTS, Table, merged, read_toml

T = TypeVar("T")
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
NO_EXPERIMENT = Experiment(0.0, 1.0, 1.0, 1)


@dataclass(frozen=True)
class Draft:
    """A scenario as far as it could be read, the problems met, and the sections they are in."""

    scenario: Scenario | None
    problems: list[str]
    broken: frozenset[str] = frozenset()


def load(path: str | Path, variant: str | None = None) -> Scenario:
    """Scenario of a file (or of `scenario.toml` in a folder), with one of its variants applied.

    Parameters
    ----------
    path : str or Path
        Scenario file, or its folder.
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
    draft = read_draft(path, variant)
    if draft.problems or draft.scenario is None:
        raise ScenarioError(draft.problems)
    return draft.scenario


def read_draft(path: str | Path, variant: str | None = None) -> Draft:
    """Scenario as far as it can be read, with the problems found."""
    file = scenario_file(path)
    problems: list[str] = []
    data = read_toml(file, problems)
    if data is None:
        return Draft(None, problems)
    chosen = with_variant(data, variant, file, problems)
    if chosen is None:
        return Draft(None, problems)
    reader = Reader(file, variant, Table(chosen, file.name, "", problems))
    return Draft(reader.scenario(), problems, frozenset(reader.broken))


def scenario_file(path: str | Path) -> Path:
    """The scenario file itself, also if its folder is given."""
    path = Path(path)
    return path / "scenario.toml" if path.is_dir() else path


def with_variant(data: dict[str, Any], variant: str | None, file: Path, problems: list[str]) -> dict[str, Any] | None:
    """Content of the file with a variant laid over it, or None if there is no such variant."""
    if variant is None:
        return data
    variants = data.get("variants")
    if not isinstance(variants, dict) or not isinstance(variants.get(variant), dict):
        known = variants if isinstance(variants, dict) else {}
        problems.append(f"{file.name}: there is no variant `{variant}`. {suggest(variant, known)}")
        return None
    return merged({k: v for k, v in data.items() if k != "variants"}, variants[variant]) | {"variants": variants}


class Reader:
    """Reads the sections of one scenario file; `broken` holds the sections with problems."""

    def __init__(self, path: Path, variant: str | None, table: Table) -> None:
        self.path, self.variant, self.table = path, variant, table
        self.broken: set[str] = set()
        self.files: list[Path] = [path]

    def scenario(self) -> Scenario:
        """All sections, in the order in which the format describes them."""
        table = self.table
        experiment = self.section("experiment", self.experiment)
        components = self.section("components", self.components)
        grid, rows, columns = self.section(
            "sweep", lambda table: sections.read_sweep(table, self.path.parent, self.files)
        )
        scenario = Scenario(
            path=self.path,
            title=table.take("title", TEXT, "", required=True),
            description=table.take("description", TEXT, ""),
            figure=table.take("figure", TEXT, "overview"),
            variant=self.variant,
            experiment=experiment,
            components=components,
            connections=self.section("connections", sections.read_connections),
            inputs=self.section("inputs", sections.read_inputs),
            seeds=self.section("seeds", self.seeds),
            grid=grid,
            rows=rows,
            record=self.section("record", sections.read_record),
            metrics=self.section("metrics", sections.read_metrics),
            baseline=self.section("baseline", lambda table: sections.read_baseline(table, self.path, self.variant)),
            variants=self.section("variants", self.variants),
            tested=self.tested(),
            files=tuple(dict.fromkeys(self.files)),
            rows_columns=columns,
        )
        table.finish()
        return scenario

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
        start = table.take("start", NUMBER, 0.0)
        stop = table.take("stop", NUMBER, required=True)
        base = table.take("base_step", POSITIVE, required=True)
        method = table.choice("method", METHODS, "gauss-seidel")
        pace = table.take("pace", POSITIVE)
        isolation = table.choice("isolation", ISOLATIONS, "none")
        limit = table.take("step_limit", POSITIVE, STEP_LIMIT)
        table.finish()
        if stop is None or base is None:
            return NO_EXPERIMENT
        read = grid(table, float(start), float(stop), float(base), str(method), pace) or NO_EXPERIMENT
        return replace(read, isolation=str(isolation), step_limit=float(limit))

    def components(self, table: Table) -> dict[str, Component]:
        """Components by name, in the order of the file."""
        table = table.table("components")
        if not table.data:
            table.note("", "there is no component. Add a table `[components.<name>]`.")
        good = [name for name in table.data if NAME.fullmatch(name)]  # signals are written `component.variable`
        for name in [name for name in table.data if name not in good]:
            table.note(name, "a component's name is letters, digits and `_`, not starting with a digit. Rename it.")
        return {name: self.component(table.table(name), name) for name in good}

    def component(self, table: Table, name: str) -> Component:
        """One component with the values of its parameter sets; later sets win, `set` wins over all."""
        files = [self.path.parent / file for file in table.take("parameters", TEXTS, [])]
        sets = {path: read_parameters(path, table.problems) for path in files}
        inline = table.table("set")
        layers = [(path.name, sets[path]) for path in files]
        layers.append((inline.where(), located_values(inline, self.path.parent)))
        given = [(place, name, value) for place, layer in layers for name, value in layer.items()]
        self.files += [*files, *(Path(str(value)) for _, name, value in given if is_file(name, value))]
        component = Component(
            name=name,
            fmu=table.take("fmu", TEXT, "", required=True),
            step=table.take("step", COUNT, 1),
            offset=table.take("offset", INDEX, 0),
            values={name: value for _, name, value in given},
            origin={name: place for place, name, _ in given},
            sets=sets,
            isolation=str(table.choice("isolation", ISOLATIONS, "none")),
        )
        table.finish()
        return component

    def seeds(self, table: Table) -> dict[str, int]:
        """Seed of each random component."""
        table = table.table("seeds")
        return {name: table.take(name, INDEX, 0) for name in table.data}

    def variants(self, table: Table) -> dict[str, str]:
        """Description of each variant; their content is read only when one is chosen."""
        table = table.table("variants")
        out: dict[str, str] = {}
        for name in table.data:
            item = table.table(name)
            out[name] = item.take("description", TEXT, "")
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
    """The time grid, or None if the run is not a whole number of base steps."""
    count = round((stop - start) / base)
    slack = 1e-9 * base + 1e-15 * (abs(start) + abs(stop))
    if count >= 1 and abs(start + count * base - stop) <= slack:
        return Experiment(start, stop, base, count, method, pace)
    table.note(
        "",
        f"the run from {start:.9g} s to {stop:.9g} s is {(stop - start) / base:.9g} steps of {base:.9g} s, "
        "and must be a whole number of at least 1. Change `stop` or `base_step`.",
    )
    return None
