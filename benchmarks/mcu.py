"""What exported components take on a Cortex-M3 and a Cortex-M4F: `python benchmarks/mcu.py [--write]`.

Built by arm-none-eabi-gcc with -Os, run by QEMU, which counts instructions and knows no waiting for memory.  The FMUs
in build/fmus play the scenarios that the inputs are from.  `--write` puts the table into docs/microcontrollers.md.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "mcu"))
from board import BOARDS, missing_tools
from costs import BEGIN, END, PAGE, ROWS, line, measured, table


def main() -> int:
    """Measure and print; exit code 2 without the tools."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="also into the page")
    is_written = parser.parse_args().write
    if missing := missing_tools():
        print(f"{', '.join(missing)} not found. Install them.", file=sys.stderr)
        return 2
    lines = []
    for row in ROWS:
        lines.append(line(row, {board: measured(row, board) for board in BOARDS}))
        print(lines[-1], flush=True)
    if is_written:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        PAGE.write_text(before + BEGIN + table(lines) + END + rest.partition(END)[2], encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
