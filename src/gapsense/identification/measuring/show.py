"""Tables of how wrong `identify` is with records of the bench."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from gapsense.identification.measuring.examples import Outcome
from gapsense.report.table import table

SHOWN = (
    "coil_resistance",
    "coil_turns",
    "core_reluctance",
    "core_saturation",
    "spring_stiffness",
    "mover_mass",
    "damping",
)
HEADS = ("record", "R", "turns", "core", "saturation", "spring", "mass", "friction", "explained")


def rows(found: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """Largest errors in percent, and whether `identify` calls the record explained."""
    return [
        (o.condition.name, *(f"{100.0 * o.errors[name]:.2g}" for name in SHOWN), "yes" if o.is_explained else "no")
        for o in found
    ]


def outcome_table(found: Sequence[Outcome]) -> Table:
    """The same as a table."""
    return table("Errors of `gapsense identify`, percent", HEADS, rows(found))


def markdown(found: Sequence[Outcome]) -> str:
    """The same for a page."""
    lines = [HEADS, ("---",) * len(HEADS), *rows(found)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
