"""What exported components take on microcontrollers: the rows of the table in docs/microcontrollers.md."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

from board import BOARDS, Cost, cost
from host import ROOT

from gapsense.embedded.design import Design, designed
from records import in_scenario

PAGE = ROOT / "docs" / "microcontrollers.md"
BEGIN, END = "<!-- measured by benchmarks/mcu.py -->\n", "<!-- end -->\n"
FOUR = ("resistance", "inductance", "flux_linkage", "quality")
HEAD = (
    "| component | outputs | M3: instructions, mean and most | flash | M4F: instructions, mean and most | flash | RAM |"
    " stack | largest error of float |"
)


class Row(NamedTuple):
    """A component, its record, and what is exported of it."""

    scenario: str
    part: str
    outputs: tuple[str, ...] = ()  # all
    is_baked: bool = False
    watched: str = "flux_linkage"  # output whose error is shown
    is_lean: bool = False


ROWS = (
    Row("semera_valve", "semera"),
    Row("semera_valve", "semera", FOUR),
    Row("semera_valve", "semera", FOUR, True),
    Row("semera_valve", "semera", FOUR, True, is_lean=True),
    Row("semera_valve", "integral", FOUR, True),
    Row("estimators", "ekf", watched="position"),
    Row("estimators", "ekf", ("position", "flux_linkage"), True, "position"),
    Row("estimators", "hybrid_ekf", ("position", "mode"), True, "position"),
    Row("estimators", "bounded_ukf", ("position", "flux_linkage"), True, "position"),
    Row("estimators", "ertss", ("position", "smoothed_position", "smoothed_published"), True, "position"),
    Row("estimators", "mhe", ("position", "resistance", "flux_linkage"), True, "position"),
)


def design_of(row: Row) -> Design:
    """What is exported."""
    given = in_scenario(row.scenario, row.part)
    return designed(given.folder, "float", row.outputs, given.values, row.is_baked, row.is_lean)


def measured(row: Row, board: str) -> Cost:
    """What a row takes on a board, in float."""
    with tempfile.TemporaryDirectory() as folder:
        return cost(design_of(row), in_scenario(row.scenario, row.part).rows, board, Path(folder))


def line(row: Row, costs: dict[str, Cost]) -> str:
    """A row of the table."""
    m3, m4 = (costs[board] for board in BOARDS)
    error, largest = m4.errors[row.watched]
    what = ", ".join(row.outputs) or "all"
    cells = [
        f"`{in_scenario(row.scenario, row.part).folder.name}`{', baked' * row.is_baked}{', lean' * row.is_lean}",
        what,
        *(cell for c in (m3, m4) for cell in (f"{c.mean:,.0f}, {c.most:,.0f}", f"{c.flash:,}")),
        f"{m4.memory:,}",
        f"{max(m3.stack, m4.stack):,}",
        f"{row.watched} {error:.1e} of {largest:.2g}",
    ]
    return f"| {' | '.join(cells)} |"


def table(lines: list[str]) -> str:
    """The table of the page."""
    return "\n".join([HEAD, "| --- " * (HEAD.count("|") - 1) + "|", *lines, ""])
