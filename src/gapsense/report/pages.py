"""Scenarios, results and sweeps as HTML, as notebooks show them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from gapsense.cosim.result.metrics import Measured, Vector
from gapsense.problems import InputError
from gapsense.report.table import quantity

SHOWN = 20  # rows of a table
RIGHT = ' style="text-align: right"'


def of_scenario(tables: Mapping[str, Any], line: str) -> str:
    """Components, and what their inputs are."""
    components = [
        (name, own.get("fmu", ""), ", ".join(f"{key} = {value}" for key, value in own.get("set", {}).items()))
        for name, own in tables["components"].items()
    ]
    wires = [*tables.get("connect", {}).items(), *((c["to"], c["from"]) for c in tables.get("connections", ()))]
    inputs = [*wires, *((name, str(value)) for name, value in tables.get("inputs", {}).items())]
    made = table(("component", "FMU", "parameters"), components, texts=3)
    return heading(tables["title"], line) + made + table(("input", "comes from"), inputs, texts=2)


def of_result(
    title: str, line: str, metrics: Mapping[str, Measured], signals: Mapping[str, Vector], units: Mapping[str, str]
) -> str:
    """Metrics, and the range of each signal."""
    measured = [
        (m.label or name, quantity(m.value, m.unit), "" if m.passed else "outside its bounds")
        for name, m in metrics.items()
    ]
    ranges = [
        (name, *(quantity(float(value), units[name]) for value in (np.min(y), np.max(y), y[-1])))
        for name, y in signals.items()
        if y.size
    ]
    made = table(("metric", "value", ""), measured)
    return heading(title, line) + made + table(("signal", "least", "greatest", "last"), ranges)


def of_sweep(line: str, quantiles: Mapping[str, Sequence[float]], units: Mapping[str, str]) -> str:
    """Median and 5-95 % range of each metric."""
    rows = [
        (name, *(quantity(values[k], units.get(name, "")) for k in (1, 0, 2))) for name, values in quantiles.items()
    ]
    return heading("Sweep", line) + table(("metric", "median", "5 %", "95 %"), rows)


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


# Results as pandas tables; pandas is optional.


def frame(columns: Mapping[str, Any], name: str, index: Any, units: Mapping[str, str]) -> Any:
    """A DataFrame with an index of that name; units by column are in `attrs["units"]`."""
    try:
        import pandas
    except ImportError:
        sentence = "pandas is not installed. Install it with `pip install 'gapsense[pandas]'`."
        raise InputError([sentence]) from None
    made = pandas.DataFrame(dict(columns), index=pandas.Index(index, name=name))
    made.attrs["units"] = dict(units)
    return made
