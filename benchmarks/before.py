"""What a change does to the Python FMUs: set, step and get together, of the FMUs in one folder and in another.

python benchmarks/before.py OLD [NAME ...]    against build/fmus, whose FMUs must have the same inputs and outputs

Microseconds per step from a host in C, the two in turn, the median of five and their ratio.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from pathlib import Path
from statistics import median

from native import KINDS, ROUNDS, from_c, write_table

from gapsense.fmi.components import COMPONENTS, find_components, load_component


def main(old: Path, names: list[str]) -> None:
    """Print the table."""
    print(f"{'us per step':20}{'before':>10}{'now':>10}{'ratio':>10}")
    for folder in find_components(COMPONENTS, names):
        before, now = compared(folder, (old, KINDS["Python"]))
        print(f"{folder.name:20}{before:10.3f}{now:10.3f}{now / before:10.2f}", flush=True)


def compared(folder: Path, kinds: tuple[Path, Path]) -> tuple[float, float]:
    """Medians of a component's FMU in two folders."""
    component = load_component(folder)
    with tempfile.TemporaryDirectory() as work:
        table = write_table(component, folder, Path(work, "table.csv"))
        unpacked = [Path(work, name) for name in ("before", "now")]
        for kind, to in zip(kinds, unpacked):
            with zipfile.ZipFile(kind / f"{component.name}.fmu") as archive:
                archive.extractall(to)
        before, now = zip(*([from_c(component, to, table) for to in unpacked] for _ in range(ROUNDS)))
    return median(before), median(now)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
