"""Examples run from top to bottom, show what their pages say, and are notebooks too."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import nbformat
import pytest
from sources import ROOT

sys.path.append(str(ROOT / "docs"))
import cells

EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
SAYS = {  # what must be printed, beside pictures, whose number follows
    "campaign": (r"semera_resistance_after +0\.0", 1),
    "first_cosimulation": (r"\[\]\n.*<Result 'my actuator': 2001 rows.*48 Ohm: RMS error of the position 2\d um", 1),
    "soft_landing": (r"cycle  1: 0\.8\d m/s.*cycle 39: 0\.[01]\d m/s", 1),
    "which_estimator": (r"Semera: 53\.0 Ohm.*Mhe: 53\.0 Ohm.*Ertss with Semera +5 um", 1),
    "your_valve": (r"coil\.resistance +46\.\d+.*explains the record: True.*gap from 0\.05 mm to 0\.75 mm", 3),
}


@pytest.fixture(params=EXAMPLES, ids=lambda file: file.stem)
def example(request: pytest.FixtureRequest) -> Path:
    return request.param


@pytest.mark.parametrize(
    "file", [pytest.param(f, marks=[pytest.mark.slow] * (f.stem != "first_cosimulation"), id=f.stem) for f in EXAMPLES]
)
def test_example_runs_and_its_page_shows_it(file):
    done = cells.shown(file)
    says, pictures = SAYS[file.stem]
    page = cells.page(file.stem, done)
    assert re.search(says, "\n".join(ran.printed for _, ran in done), re.DOTALL)
    assert page.count("![") == pictures == sum(ran.picture is not None for _, ran in done)
    assert f"[notebook]({file.stem}.ipynb)" in page and page.startswith("# ")


def test_example_is_a_notebook_and_is_listed(example):
    parts = cells.cells(example.read_text(encoding="utf-8"))
    book = nbformat.reads(cells.notebook(parts), as_version=4)
    nbformat.validate(book)
    assert [cell.cell_type for cell in book.cells] == ["markdown" if part.is_text else "code" for part in parts]
    assert f"(examples/{example.name})" in (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    assert {file.stem for file in EXAMPLES} == set(SAYS)
