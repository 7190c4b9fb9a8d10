"""What exported components take on microcontrollers: the rows of the tables in docs/microcontrollers.md."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from board import BOARDS, Cost, cost
from board import EVERY as MACHINES
from host import ROOT

from gapsense.cosim import load
from gapsense.embedded.design import Design, make_design
from records import Given, in_scenario

PAGE = ROOT / "docs" / "microcontrollers.md"
BEGIN, BEGIN_OF_ALL, END = "<!-- measured by benchmarks/mcu.py -->\n", "<!-- so is this -->\n", "<!-- end -->\n"
FOUR = ("resistance", "inductance", "flux_linkage", "quality")
HEAD = (
    "| component | outputs | M3: instructions, mean and most | flash | M4F: instructions, mean and most | flash | RAM |"
    " stack | largest error of float |"
)


HEAD_OF_ALL = (
    "| component | numbers | M3: mean and most | M4F: mean and most | M7: mean and most | RAM | flash | stack |"
)


class Row(NamedTuple):
    """A component, its record, and what is exported of it."""

    scenario: str
    part: str
    outputs: tuple[str, ...] = ()  # all
    is_baked: bool = False
    watched: str = "flux_linkage"  # output whose error is shown
    is_lean: bool = False
    given: tuple[tuple[str, float], ...] = ()  # parameters that are other than in the scenario
    variant: str | None = None
    real: str = "float"

    def fmu(self) -> str:
        """Name of its FMU, for which its scenario need not run."""
        return load(ROOT / "scenarios" / self.scenario, self.variant).components[self.part].fmu

    def record(self) -> Given:
        """What it gets in its scenario."""
        return in_scenario(self.scenario, self.part, variant=self.variant)


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
    Row(
        "estimators",
        "ertss",
        ("position", "smoothed_position", "smoothed_published"),
        True,
        "smoothed_position",
        given=(("motion.memory", 208.0),),
    ),
    Row("estimators", "mhe", ("position", "resistance", "flux_linkage"), True, "position"),
)
EVERY = (  # a row for each component, with all outputs
    Row("estimators", "bounded_ukf"),
    Row("estimators", "drive"),
    Row("estimators", "ekf"),
    Row("estimators", "ertss"),
    Row("estimators", "hybrid_ekf"),
    Row("semera_valve", "integral"),
    Row("estimators", "mhe"),
    Row("condition", "monitor"),
    Row("estimators", "actuator", variant="other_physics"),
    Row("pot_magnet", "magnet"),
    Row("power_stage", "stage"),
    Row("estimators", "actuator"),
    Row("run_to_run", "controller", variant="model"),
    Row("semera_valve", "semera"),
    Row("estimators", "sensor"),
    Row("semera_valve", "valve"),
    Row("lifting_magnet", "magnet"),
)


def design_of(row: Row) -> Design:
    """What is exported."""
    found = row.record()
    values = {**found.values, **dict(row.given)}
    return make_design(found.folder, row.real, row.outputs, values, row.is_baked, row.is_lean)


def measured(row: Row, board: str) -> Cost:
    """What a row takes on a board."""
    with tempfile.TemporaryDirectory() as folder:
        return cost(design_of(row), row.record().rows, board, Path(folder))


def line(row: Row, costs: Mapping[str, Cost]) -> str:
    """A row of the first table."""
    m3, m4 = (costs[board] for board in BOARDS)
    error, largest = m4.errors[row.watched]
    given = "".join(f", `{name}` {value:,.0f}" for name, value in row.given)
    cells = [
        f"`{row.record().folder.name}`{', baked' * row.is_baked}{', lean' * row.is_lean}{given}",
        ", ".join(row.outputs) or "all",
        *(cell for c in (m3, m4) for cell in (_instructions(c), f"{c.flash:,}")),
        f"{m4.memory:,}",
        f"{max(m3.stack, m4.stack):,}",
        f"{row.watched} {error:.1e} of {largest:.2g}",
    ]
    return f"| {' | '.join(cells)} |"


def _instructions(one: Cost) -> str:
    return f"{one.mean:,.0f}, {one.most:,.0f}"


def line_of_all(row: Row, costs: Mapping[str, Cost]) -> str:
    """A row of the second table."""
    last = costs["Cortex-M7"]
    cells = [
        f"`{row.record().folder.name}`",
        row.real,
        *(_instructions(costs[board]) for board in MACHINES),
        f"{last.memory:,}",
        f"{max(one.flash for one in costs.values()):,}",
        f"{max(one.stack for one in costs.values()):,}",
    ]
    return f"| {' | '.join(cells)} |"


def table(head: str, lines: Sequence[str]) -> str:
    """A table of the page."""
    return "\n".join([head, "| --- " * (head.count("|") - 1) + "|", *lines, ""])
