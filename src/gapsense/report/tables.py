"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from gapsense.cosim import Measured, Outcome, Result, Scenario, Sweep
from gapsense.fmi.ports import Component

PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"))
UNPREFIXED = ("m2", "kg", "1/H", "1/(H.m)")  # a prefix in front would mean something else


def quantity(value: float, unit: str) -> str:
    """Four digits with an SI prefix, as the papers print: `4.199 mOhm`."""
    value = float(f"{value:.4g}")  # first, or 0.99999 Ohm becomes 1000 mOhm
    if unit in ("", "1") or value != value:
        return f"{value:.4g}"
    smallest = PREFIXES[-1] if value else PREFIXES[0]
    factor, prefix = next(((f, p) for f, p in PREFIXES if abs(value) >= f), smallest)
    if unit in UNPREFIXED:
        factor, prefix = PREFIXES[0]
    return f"{value / factor:.4g} {prefix}{unit}"


def new_table(title: str, *columns: str) -> Table:
    """An empty table; its first column is text, the others are numbers."""
    table = Table(title=Text(title, "table.title") if title else None, box=box.SIMPLE_HEAD, title_justify="left")
    for k, column in enumerate(columns):
        table.add_column(column, justify="left" if k == 0 else "right")
    return table


def add_row(table: Table, *cells: str, style: str | None = None) -> None:
    """Add a row of plain texts: `[m]` in one is a unit, no markup."""
    table.add_row(*map(Text, cells), style=style)


def _grouped(measured: Iterable[Measured]) -> Iterator[tuple[str, list[Measured]]]:
    groups: dict[str, list[Measured]] = {}
    for m in measured:
        groups.setdefault(m.table, []).append(m)
    yield from groups.items()


def metrics(result: Result) -> list[Table]:
    """Metrics of a run, grouped as the scenario says, beside published values."""
    made = []
    for title, group in _grouped(result.metrics.values()):
        table = new_table(title or "Metrics", "metric", "published", "this run", "bounds")
        for m in group:
            bounds = "" if m.bounds is None else " to ".join(quantity(b, m.unit) for b in m.bounds)
            shown = (m.label, _published(m), quantity(m.value, m.unit), bounds)
            add_row(table, *shown, style=None if m.passed else "red")
        made.append(table)
    return made


def sweep(scenario: Scenario, swept: Sweep) -> list[Table]:
    """Median and 5-95 % range of each metric beside the published value and the first run."""
    if not swept.indices:
        return []
    quantiles = swept.quantiles()
    runs, first_run = ("runs", "first run") if swept.grid else ("seeds", "first seed")
    groups: dict[str, Table] = {}
    for metric in scenario.metrics:
        title = f"{metric.table or 'Metrics'}, {len(swept.indices)} {runs}"
        if title not in groups:
            groups[title] = new_table(title, "metric", "published", first_run, "median", "5 %", "95 %")
        unit = swept.units.get(metric.name, "")
        low, median, high = (quantity(v, unit) for v in quantiles[metric.name])
        published = "" if metric.published is None else quantity(metric.published, unit)
        first = quantity(float(swept.metrics[metric.name][0]), unit) if swept.indices[0] == 0 else "-"
        add_row(groups[title], metric.label, published, first, median, low, high)
    return list(groups.values())


def _published(measured: Measured) -> str:
    return "" if measured.published is None else quantity(measured.published, measured.unit)


def timing(result: Result) -> Table:
    """Time of each component, and the whole run against real time."""
    span = result.times[-1] - result.times[0]
    title = f"{result.wall:.3f} s for {span:.4g} s: real-time factor {result.realtime_factor:.3g}"
    table = new_table(title, "component", "steps", "us per step", "share")
    for name, t in result.timing.items():
        add_row(table, name, str(t.calls), f"{t.microseconds:.1f}", f"{100 * t.seconds / result.wall:.0f} %")
    return table


def components(found: Sequence[Component], built: set[str]) -> Table:
    """Components and what they do."""
    table = new_table("Components", "name", "built", "inputs", "outputs", "what it is")
    table.columns[-1].justify = "left"
    for c in found:
        counts = (str(len(c.of(causality))) for causality in ("input", "output"))
        add_row(table, c.name, "yes" if c.name in built else "no", *counts, c.description)
    return table


def scenarios(root: Path, found: Sequence[tuple[Path, Scenario]]) -> Table:
    """Scenarios and their variants."""
    table = new_table("Scenarios", "folder", "variants", "what it is")
    table.columns[1].justify = table.columns[2].justify = "left"
    for folder, scenario in found:
        add_row(table, str(folder.relative_to(root)), ", ".join(scenario.variants) or "-", scenario.title)
    return table


def outcome(tested: Outcome) -> str:
    """One line for a scenario that passed, one more for each failure."""
    word = "passed" if tested.passed else "FAILED"
    head = f"{word}  {tested.scenario}  {len(tested.checks)} checks, {tested.seconds:.1f} s"
    return "\n".join([head, *(f"  {c.name}: {c.failure}" for c in tested.failures)])
