"""What exported components take on a Cortex-M3, M4F and M7: `python benchmarks/mcu.py [--write] [--only NAME ...]`.

Built by arm-none-eabi-gcc with -Os, run by QEMU, which counts instructions and knows no waiting for memory.  The FMUs
in build/fmus play the scenarios that the inputs are from.  Two tables, of chosen outputs in float and of all outputs of
all components in float and double; `--write` puts them into docs/microcontrollers.md, which takes half an hour, or with
`--only` a minute for each component, whose rows alone are written.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "mcu"))
from board import BOARDS, missing_tools
from board import EVERY as MACHINES
from costs import (
    BEGIN,
    BEGIN_OF_ALL,
    END,
    EVERY,
    HEAD,
    HEAD_OF_ALL,
    PAGE,
    ROWS,
    Row,
    line,
    line_of_all,
    measured,
    table,
)
from host import ROOT

from gapsense.embedded.design import REALS
from gapsense.fmi.components import load_component


def main() -> int:
    """Measure and print; nothing without the tools."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="also into the page")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these components")
    given = parser.parse_args()
    if missing := missing_tools():
        print(f"{', '.join(missing)} not found: nothing was measured. Install them.")
        return 2 if given.write else 0
    every = [row._replace(real=real) for row in EVERY for real in REALS]
    chosen, all_outputs = ([row for row in rows if is_chosen(row, given.only)] for rows in (ROWS, every))
    found = {BEGIN: show(HEAD, chosen, BOARDS, line)} if chosen else {}
    found[BEGIN_OF_ALL] = show(HEAD_OF_ALL, all_outputs, MACHINES, line_of_all)
    for begin, text in found.items() if given.write else ():
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(begin)
        old, _, after = rest.partition(END)
        PAGE.write_text(before + begin + (replaced(old, text) if given.only else text) + END + after, encoding="utf-8")
    return 0


def is_chosen(row: Row, only: Sequence[str] | None) -> bool:
    """Whether a row is of one of these components; of any, if none are given."""
    return not only or row.fmu() in [load_component(ROOT / "fmus" / name).name for name in only]


def replaced(old: str, new: str) -> str:
    """A table with the rows of another: in place of those with the same first two cells, or at the end."""
    rows = {tuple(row.split("|")[1:3]): row for row in (*old.splitlines(), *new.splitlines())}
    return "\n".join([*rows.values(), ""])


def show(head: str, rows: Iterable[Row], boards: Iterable[str], cells: Callable[..., str]) -> str:
    """A table, printed row by row as it is measured."""
    print(table(head, []), end="")
    lines = []
    for row in rows:
        lines.append(cells(row, {board: measured(row, board) for board in boards}))
        print(lines[-1], flush=True)
    return table(head, lines)


if __name__ == "__main__":
    sys.exit(main())
