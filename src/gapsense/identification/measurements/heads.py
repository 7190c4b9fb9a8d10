"""Where the columns of a file begin: what instruments write above their heads, and units in a row of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gapsense.fmi.tables import HEADER

MOST = 60  # rows above the heads
SEPARATORS = {";": '";"', "\t": "$'\\t'"}  # that a file may have in place of a comma, and as a shell takes them


class Line(NamedTuple):
    """A line of a file with its number."""

    number: int
    cells: list[str]


def from_heads(lines: Sequence[Line], decimal: str) -> list[Line]:
    """Lines from the heads of the columns on, with the units of the row below them, if there is one."""
    heads = next((k for k, line in enumerate(lines[:MOST]) if any(map(is_time, line.cells))), 0)
    first, *rest = [*lines[heads:]] or [Line(1, [])]
    if rest and not any(is_number(cell, decimal) for cell in rest[0].cells):
        units = [cell.strip().strip("()[]") for cell in rest[0].cells] + [""] * len(first.cells)
        return [first._replace(cells=[*map(with_unit, first.cells, units)]), *rest[1:]]
    return [first, *rest]


def is_time(cell: str) -> bool:
    """Whether a cell is the head of the column of times."""
    found = HEADER.fullmatch(cell)
    return found is not None and found[1].lower() == "time"


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number, NaN included."""
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True


def with_unit(head: str, unit: str) -> str:
    """A head with its unit; one that has a unit keeps it."""
    found = HEADER.fullmatch(head)
    return f"{head.strip()} [{unit}]" if unit and found and found[1] and not found[2] else head


def other_separator(lines: Sequence[Line], separator: str) -> str:
    """Sentence on a file whose cells are separated by something else than a comma, or nothing."""
    whole = [line.cells[0] for line in lines[:MOST] if len(line.cells) == 1]
    heads = next((text for text in whole if "time" in text.lower()), whole[0] if whole else "")
    if separator != "," or (lines and len(lines[0].cells) > 1 and not heads):
        return ""
    found = next((s for s in SEPARATORS if s in heads), None)
    if found is None:
        return ""
    has_commas = any(len(line.cells) > 1 for line in lines[1:])
    more = " --decimal ," if has_commas else ""
    word = "semicolons" if found == ";" else "tabs"
    return f"the cells are separated by {word}; commas are expected. Add `--separator {SEPARATORS[found]}{more}`."
