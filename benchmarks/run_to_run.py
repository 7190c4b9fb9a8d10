"""What a step of `Mhe` and `RunToRun` costs in their FMUs, in the closed loop of the example without a contact.

python benchmarks/run_to_run.py [FOLDER ...]    after `python build_fmus.py` and `python build_fmus.py --native`

Each FMU by itself in a loop in C, on the inputs that it had in the scenario; of each of the steps the shortest of some
runs, since others disturb single ones.  The steps of the first three cycles, which find memory and code cold (soft ones
begin in the third one), have a column of their own.  Bound: no later step of both together costs more than five times
the median.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from actuator_steps import Run, alone, recorded
from bounds import hold
from c_loop import Rows
from experiment import ROOT
from rich.console import Console
from rich.table import Table

from gapsense.cosim.scenario.records import Port

SCENARIO, VARIANT = ROOT / "scenarios" / "run_to_run", "model"
PARTS = {"mhe": "Mhe", "controller": "RunToRun"}
FOLDERS = [ROOT / "build" / "fmus", ROOT / "build" / "native"]
WARM = 3000  # steps of the first three cycles
RATIO = 5.0  # of the largest step to the median, of both together


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path, default=FOLDERS, help="folders of FMUs")
    parser.add_argument("--times", type=int, default=7, help="runs of which the shortest steps are taken")
    options = parser.parse_args()
    table, together = Table(title="Microseconds of a step"), {}
    for column in ("FMUs", "", "cold", "median", "99 %", "largest", "over the median"):
        table.add_column(column, justify="left" if column in ("FMUs", "") else "right")
    for folder in options.folders:
        run = recorded(SCENARIO, folder.resolve(), Port("actuator", "mode"), (2.0,), VARIANT)
        steps = {title: shortest(run, name, options.times) for name, title in PARTS.items()}
        together[folder.name] = sum(steps.values())
        for title, each in {**steps, "together": together[folder.name]}.items():
            table.add_row(folder.name, title, *shown(each))
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    for name, each in together.items():
        later = each[WARM:]
        hold(
            f"{name}, largest step of both FMUs over the median",
            float(np.max(later) / np.median(later)),
            RATIO,
            "times",
        )


def shortest(run: Run, name: str, times: int) -> Rows:
    """Microseconds of each step, the shortest of some runs."""
    return 1e6 * np.min([alone(run.experiment, run.rows[1:], name, {}) for _ in range(times)], axis=0)


def shown(each: Rows) -> list[str]:
    """Cells of a row."""
    cold, later = np.max(each[:WARM]), each[WARM:]
    median, most, largest = np.median(later), np.quantile(later, 0.99), np.max(later)
    return [f"{cold:.2f}", f"{median:.2f}", f"{most:.2f}", f"{largest:.2f}", f"{largest / median:.1f}"]


if __name__ == "__main__":
    main()
