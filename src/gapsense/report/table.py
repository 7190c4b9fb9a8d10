"""The one table maker: what every command and every study prints."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"))
UNPREFIXED = ("m2", "kg", "1/H", "1/(H.m)")  # a prefix in front would mean something else
WIDE = 200  # of a table as text
READABLE = 24  # characters in a line of a long text
BOUND = "\N{NO-BREAK SPACE}"
FRAME, GAP = 4, 3  # blanks around a table, and between two columns


def quantity(value: float, unit: str) -> str:
    """Four digits with an SI prefix, as the papers print: `4.199 mOhm`."""
    value = float(f"{value:.4g}")  # first, or 0.99999 Ohm becomes 1000 mOhm
    if unit in ("", "1") or value != value:
        return f"{value:.4g}"
    factor, prefix = choose_prefix(value, unit)
    return f"{value / factor:.4g} {prefix}"


def percent(share: float) -> str:
    """Two digits: `1.2 %`."""
    return f"{100.0 * share:.2g} %"


def choose_prefix(value: float, unit: str) -> tuple[float, str]:
    """Choose the SI prefix that suits a value: its factor, and the unit with it."""
    smallest = PREFIXES[-1] if value else PREFIXES[0]
    factor, prefix = next(((f, p) for f, p in PREFIXES if abs(value) >= f), smallest)
    return (1.0, unit) if unit in UNPREFIXED else (factor, f"{prefix}{unit}")


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]] = (), texts: int = 1) -> Table:
    """A table of plain texts: `[m]` in one is a unit, no markup.

    The first `texts` columns from the left hold texts, the others numbers. Cells at the end of a row may be missing.
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


def show(console: Console, *items: Table | str) -> None:
    """Print tables, each as wide as the console at most, and sentences; `[m]` in a sentence is a unit, no markup."""
    for item in items:
        if isinstance(item, str):
            console.print(item, markup=False, soft_wrap=not console.is_terminal)
        else:
            parts = fit_to_width(item, console.width)
            console.print(*([Text(str(item.title), "table.title")] if item.title else []), *parts, soft_wrap=False)


def fit_to_width(made: Table, width: int) -> list[Table]:
    """Fit a table, without its title, to a width, in parts if it is too wide; each part has the first column again."""
    first, *others = made.columns
    whole = {id(c): max(measure_width(c), cell_len(str(c.header))) for c in made.columns}
    if sum(whole.values()) + GAP * len(others) + FRAME <= width:
        return [part(made, made.columns, whole)]
    widths = {id(c): measure_width(c) for c in made.columns}
    room = width - FRAME - widths[id(first)]
    least = split(others, widths, room, len(others))
    even = split(others, widths, room, -(-len(others) // len(least)))
    return [part(made, [first, *columns], widths) for columns in even]


def split(columns: Sequence[Column], widths: Mapping[int, int], room: int, most: int) -> list[list[Column]]:
    """Columns in groups that fit into a room of characters, at most `most` in each."""
    groups: list[list[Column]] = [[]]
    for column in columns:
        group = groups[-1]
        if group and (len(group) == most or sum(widths[id(c)] + GAP for c in [*group, column]) > room):
            groups.append([])
        groups[-1].append(column)
    return groups


def part(made: Table, columns: Sequence[Column], widths: Mapping[int, int]) -> Table:
    """A table of some of the columns; headings take as many lines as they need, only long texts are wrapped."""
    taken = Table(box=box.SIMPLE_HEAD)
    for column in columns:
        lines = wrap(bound(column), max(widths[id(column)], 1), break_long_words=False, break_on_hyphens=False)
        head, is_text = Text("\n".join(lines).replace(BOUND, " ")), column.justify == "left"
        least = widths[id(column)] if is_text else None
        taken.add_column(head, justify=column.justify, no_wrap=not is_text, min_width=least)
    for row, *cells in zip(made.rows, *(column.cells for column in columns)):
        taken.add_row(*cells, style=row.style)
    return taken


def measure_width(column: Column) -> int:
    """Count the characters without which a column cannot be read; long texts in it can be wrapped."""
    texts = [str(cell) for cell in column.cells]
    longest = max(map(cell_len, texts), default=0)
    words = bound(column).split(" ")
    if column.justify == "left":
        longest = min(longest, READABLE)
        words += " ".join(texts).split()
    return max(1, longest, *map(cell_len, words))  # a column may be empty


def bound(column: Column) -> str:
    """Heading of a column, with its unit bound to the stroke before it."""
    return str(column.header).replace("/ ", f"/{BOUND}")


def text(*items: Table | str, width: int = WIDE) -> str:
    """Tables and sentences as plain text, without blanks at the ends of lines."""
    console = Console(file=io.StringIO(), width=width, highlight=False, emoji=False)
    show(console, *items)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())  # type: ignore[attr-defined]
