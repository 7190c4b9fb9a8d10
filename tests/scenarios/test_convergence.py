"""The errors of our scenarios at their base steps are those that the page on coupling tells."""

import re
from pathlib import Path

import pytest

from gapsense import converge

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| `(\w+)` \| \d+ us \| (.+) \| (\d+) of (\d+) \|$", re.MULTILINE)
ROWS = {name: rest for name, *rest in ROW.findall((ROOT / "docs" / "coupling.md").read_text(encoding="utf-8"))}
LONG = {"condition", "estimators", "run_to_run", "run_to_run_day"}  # whose studies have slow tests of their own


def test_page_has_rows_of_scenarios_that_there_are():
    shipped = {path.parent.name for path in (ROOT / "scenarios").glob("*/scenario.toml")}
    assert LONG < ROWS.keys() <= shipped


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ROWS.keys() - LONG))
def test_errors_are_those_of_the_page(name, natives):
    cells, beyond, judged = ROWS[name]
    found = converge(ROOT / "scenarios" / name, fmus=natives)
    told = []
    for is_held in (False, True):
        first = next((t for t in found.judged if (t.signal.partition(".")[0] in found.held) == is_held), None)
        order = "-" if first is None or first.order is None else f"{first.order:.2f}"
        told += [f"`{first.signal}`", f"{100 * first.of_range:.2g} %", order] if first else ["-"] * 3
    assert [read(cell) for cell in cells.split(" | ")] == [read(cell) for cell in told]
    assert (len(found.beyond), len(found.judged)) == (int(beyond), int(judged))


def read(cell: str) -> str | float:
    """A share as a number, other cells as they are."""
    return float(cell[:-2]) if cell.endswith(" %") else cell
