"""The one table maker: what every command and every study prints."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"))
UNPREFIXED = ("m2", "kg", "1/H", "1/(H.m)")  # a prefix in front would mean something else
WIDE = 200  # of a table as text, so that nothing is cut


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


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]] = (), texts: int = 1) -> Table:
    """A table of plain texts: `[m]` in one is a unit, no markup.

    Parameters
    ----------
    title : str
        Above the table; may be empty.
    columns : sequence of str
        Their headings.
    rows : iterable of sequences of str
        Cells; those at the end may be missing.
    texts : int
        How many of the columns, from the left, are texts; the others are numbers.
    """
    made = Table(title=Text(title, "table.title") if title else None, box=box.SIMPLE_HEAD, title_justify="left")
    for k, column in enumerate(columns):
        made.add_column(Text(column), justify="left" if k < texts else "right")
    for row in rows:
        add_row(made, *row)
    return made


def add_row(made: Table, *cells: str, style: str | None = None) -> None:
    """Add a row of plain texts."""
    made.add_row(*map(Text, cells), style=style)


def text(*items: Table | str) -> str:
    """Tables and sentences as plain text, without blanks at the ends of lines."""
    console = Console(file=io.StringIO(), width=WIDE, highlight=False, soft_wrap=True)
    for item in items:
        console.print(item, markup=False)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())  # type: ignore[attr-defined]
