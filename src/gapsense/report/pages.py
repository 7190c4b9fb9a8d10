"""Scenarios, results and sweeps as HTML, as notebooks show them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from gapsense.cosim import Result, Sweep
from gapsense.cosim.model import Scenario
from gapsense.report.table import quantity

SHOWN = 20  # rows of a table
RIGHT = ' style="text-align: right"'


def html(shown: Scenario | Result | Sweep) -> str:
    """A heading and tables."""
    if isinstance(shown, Scenario):
        return of_scenario(shown)
    return of_result(shown) if isinstance(shown, Result) else of_sweep(shown)


def of_scenario(scenario: Scenario) -> str:
    """Components, and what their inputs are."""
    tables = scenario.data
    components = [
        (name, own.get("fmu", ""), ", ".join(f"{key} = {value}" for key, value in own.get("set", {}).items()))
        for name, own in tables["components"].items()
    ]
    wires = [*tables.get("connect", {}).items(), *((c["to"], c["from"]) for c in tables.get("connections", ()))]
    inputs = [*wires, *((name, str(value)) for name, value in tables.get("inputs", {}).items())]
    return "".join(
        (
            heading(tables["title"], repr(scenario)),
            table(("component", "FMU", "parameters"), components, texts=3),
            table(("input", "comes from"), inputs, texts=2),
        )
    )


def of_result(result: Result) -> str:
    """Metrics, and the range of each signal."""
    metrics = [
        (m.label or name, quantity(m.value, m.unit), "" if m.passed else "outside its bounds")
        for name, m in result.metrics.items()
    ]
    signals = [
        (name, *(quantity(float(value), result.units[name]) for value in (np.min(y), np.max(y), y[-1])))
        for name, y in result.signals.items()
        if y.size
    ]
    return "".join(
        (
            heading(result.run.title, repr(result)),
            table(("metric", "value", ""), metrics),
            table(("signal", "least", "greatest", "last"), signals),
        )
    )


def of_sweep(swept: Sweep) -> str:
    """Median and 5-95 % range of each metric."""
    rows = [
        (name, *(quantity(values[k], swept.units.get(name, "")) for k in (1, 0, 2)))
        for name, values in (swept.quantiles() if swept.indices else {}).items()
    ]
    return heading("Sweep", repr(swept)) + table(("metric", "median", "5 %", "95 %"), rows)


def heading(title: str, line: str) -> str:
    """A title, and what it is in one line."""
    return f"<p><b>{escape(title)}</b><br>{escape(line)}</p>"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], texts: int = 1) -> str:
    """A table, cut where it is long; nothing if it has no rows. The columns after `texts` are numbers."""
    rows = list(rows)
    if not rows:
        return ""
    lines = [line("th", columns, texts), *(line("td", row, texts) for row in rows[:SHOWN])]
    more = len(rows) - SHOWN
    end = f"<tr><td>and {more} more</td></tr>" if more > 0 else ""
    return f"<table>{''.join(lines)}{end}</table>"


def line(tag: str, cells: Sequence[str], texts: int) -> str:
    """One row of a table."""
    made = (f"<{tag}{RIGHT * (k >= texts)}>{escape(str(cell))}</{tag}>" for k, cell in enumerate(cells))
    return f"<tr>{''.join(made)}</tr>"
