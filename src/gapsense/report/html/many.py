"""Many runs for a report: a campaign, or a sweep in the same form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from gapsense._os.files import Sheet, number, read_sheet
from gapsense.cosim.result.sidecar import absolute, relative
from gapsense.cosim.scenario.read import CAMPAIGN_FILE
from gapsense.many import summary
from gapsense.many.columns import OWN, Columns, contents
from gapsense.many.provenance import bounds
from gapsense.many.result import KEY, Campaign, is_older, read_campaign
from gapsense.many.store import Store
from gapsense.many.summary import Extremes, Leading, Spread
from gapsense.many.sweep import AGAIN, is_table, read_sidecar
from gapsense.problems import InputError
from gapsense.report.table import quantity

WORST = 3  # runs that are named for each metric
FAILED = 20  # runs that are named with their errors


@dataclass(frozen=True)
class Many:
    """Runs of a campaign or sweep in `file`; what is computed from them is computed once."""

    file: Path
    campaign: Campaign
    kind: str  # campaign or sweep

    @property
    def about(self) -> Mapping[str, Any]:
        """What was run."""
        return self.campaign.about

    @property
    def scenario(self) -> str:
        """The scenario's file from the working folder; empty if it has none, or if an older result does not tell it."""
        folder = self.file if self.kind == "campaign" else self.file.parent
        return relative(absolute(self.about.get("source", ""), folder), Path())

    @cached_property
    def spreads(self) -> dict[str, Spread]:
        """Quantiles of each metric and of each parameter that is a number."""
        names = [*self.campaign.metrics, *summary.numeric(self.campaign)] if self.campaign.rows else []
        return {name: summary.spread(self.campaign, name) for name in names}

    @cached_property
    def correlations(self) -> dict[str, list[Leading]]:
        """Correlations of each metric with the parameters."""
        return summary.correlations(self.campaign)

    @cached_property
    def levels(self) -> dict[str, list[Any] | None]:
        """Values of each parameter that has few."""
        return {name: summary.levels(self.campaign, name) for name in self.campaign.factors}

    @cached_property
    def extremes(self) -> dict[str, Extremes]:
        """The worst runs of each metric that has any value."""
        metrics = self.campaign.metrics if self.campaign.rows else ()
        return {m: summary.extremes(self.campaign, self.spreads[m], self.bounds(m), WORST) for m in metrics}

    @cached_property
    def failed(self) -> list[tuple[int, str]]:
        """The first runs that failed, and why."""
        return self.campaign.errors(FAILED)

    @cached_property
    def rows(self) -> dict[int, dict[str, Any]]:
        """Parameters and seeds of the runs that are named."""
        named = [one.run for found in self.extremes.values() for one in found.worst]
        return summary.rows(self.campaign, [*named, *(run for run, _ in self.failed)])

    def bounds(self, metric: str) -> tuple[float, float] | None:
        """Bounds of a metric."""
        return bounds(self.about, metric)

    def unit(self, name: str) -> str:
        """Unit of a column."""
        return self.campaign.units.get(name, "")

    def format_value(self, name: str, value: float) -> str:
        """Write a value of a column with its unit; a dash for none."""
        return quantity(value, self.unit(name)) if value == value else "-"

    @cached_property
    def labels(self) -> dict[str, tuple[str, str]]:
        """Table of each metric, and what it is called there."""
        told = self.about.get("labels", {})
        words = {name: told.get(name, ["", ""]) for name in self.extremes}
        return {name: (title or "Metrics", label or name) for name, (title, label) in words.items()}

    def label(self, metric: str) -> str:
        """What a metric is called outside of its table, where others may have the same label."""
        label = self.labels[metric][1]
        is_alone = sum(other == label for _, other in self.labels.values()) == 1
        return label if is_alone else f"{label} ({metric})"


def is_many(file: Path) -> bool:
    """True for what holds many runs."""
    return (file / CAMPAIGN_FILE).is_file() or is_older(file) or is_table(file)


def read_many(file: Path) -> Many:
    """A campaign or a sweep; an InputError says what is wrong with it."""
    if file.is_dir():
        return Many(file, read_campaign(file, hold=True), "campaign")
    return Many(file, of_sweep(file), "sweep")


def of_sweep(file: Path) -> Campaign:
    """The table of a sweep, as a campaign has it."""
    about, problems = read_sidecar(file), list[str]()
    sheet = read_sheet(file, problems)
    problems += [f"{file}: a metric is called `{n}`. Rename it." for n in about["metrics"] if n in OWN]
    known = {"run", *about["factors"], *about["metrics"]}
    if problems or {*sheet.names} != known:
        raise InputError(problems or [f"{file}: other columns than its side-car tells. {AGAIN}."])
    kinds, failed = {name: kind for name, (kind, _) in about["factors"].items()}, about["failed"]
    rows = list(cells(sheet, kinds))
    given = [*rows, *(entry["values"] for entry in failed)]
    texts = {n: list(dict.fromkeys(str(row[n]) for row in given)) for n, kind in kinds.items() if kind == "string"}
    columns = Columns(about["factors"], about["metrics"], texts=texts)
    store = Store(None, KEY)
    store.describe({})
    entries = [{**entry, "index": entry["run"], "shift": entry["run"]} for entry in failed]
    for row in rows:
        measured = {name: row[name] for name in columns.metrics}
        entries.append({"index": row["run"], "shift": row["run"], "values": row, "metrics": measured})
    store.add(*contents(columns, entries))
    return Campaign(folder=file, store=store, about=about, columns=columns, rows=store.count())


def cells(sheet: Sheet, kinds: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    """Rows of a table, with the number of the run."""
    for row in sheet.rows:
        found = {name: value(text, kinds.get(name, "double")) for name, text in zip(sheet.names, row)}
        yield {**found, "run": int(found["run"] or 0)}


def value(text: str, kind: str) -> Any:
    """A cell; NaN is shown as missing."""
    if kind == "string":
        return text
    if kind == "bool":
        return text == "True"
    found = number(text)
    if found is None or found != found:
        return None
    return int(text) if kind == "int64" else found
