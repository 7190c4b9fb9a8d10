"""What whole runs and sweeps take: commands from start to end, and where the time of one run goes.

python benchmarks/whole.py [--seeds 200] [--repeats 3] [--runs 30]    after `python build_fmus.py`, also with `--native`

Aims that are missed are told. The scenario is semera_valve, sweeps have two processes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from bounds import hold
from experiment import ROOT, SCENARIO
from rich.console import Console
from rich.table import Table

import gapsense
from gapsense.cosim.check import prepare
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.run import run_once

CONSOLE = Console(width=120) if not sys.stdout.isatty() else Console()
FMUS = {"Python": ROOT / "build" / "fmus", "native": ROOT / "build" / "native"}
PATH = str(Path(gapsense.__file__).resolve().parents[1])
# as users have it: Python keeps what it has compiled
USUAL = {**{k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}, "PYTHONPATH": PATH}
PARTS = ("initialize", "loop")  # methods of `Master`
AIMS = {"native": 3.5, "Python": 20.0}  # s, of a sweep of 200 seeds


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200, help="runs of the long sweep; 0: none")
    parser.add_argument("--repeats", type=int, default=3, help="measurements of each command, of which the best counts")
    parser.add_argument("--runs", type=int, default=30, help="runs in one process, of which the median is shown")
    options = parser.parse_args()
    print_whole(options.seeds, options.repeats, options.runs)
    return 0


def print_whole(seeds: int, repeats: int, runs: int) -> None:
    """Both tables, with the kinds of FMUs that are built."""
    kinds = {kind: folder for kind, folder in FMUS.items() if any(folder.glob("*.fmu"))}
    CONSOLE.print(command_table(kinds, seeds, repeats))
    CONSOLE.print(parts_table(kinds, runs))


def command_table(kinds: dict[str, Path], seeds: int, repeats: int) -> Table:
    """Wall time of commands."""
    table = Table(title=f"Seconds from start to end: best of {repeats} (all)")
    for column in ("command", "s", "aim"):
        table.add_column(column, justify="right" if column == "s" else "left")
    for title, words, aim in commands(kinds, seeds):
        found = sorted(seconds(words) for _ in range(repeats))
        shown = f"below {aim:g} s" if aim else ""
        table.add_row(title, f"{found[0]:.2f} ({', '.join(f'{s:.2f}' for s in found)})", shown)
        if aim:
            hold(title, found[0], aim, "s")
    return table


def commands(kinds: dict[str, Path], seeds: int) -> Iterator[tuple[str, Sequence[str], float | None]]:
    """Title, arguments of Python and aim of each command."""
    yield "import gapsense", ("-c", "import gapsense"), None
    yield "gapsense --help", ("-m", "gapsense.cli", "--help"), None
    for kind, folder in kinds.items():
        end = (str(SCENARIO), "--fmus", str(folder))
        yield f"gapsense run, {kind} FMUs", ("-m", "gapsense.cli", "run", *end), None
        for count in (2, seeds) if seeds else (2,):
            words = ("-m", "gapsense.cli", "sweep", *end, "--seeds", str(count))
            yield f"gapsense sweep --seeds {count}, {kind} FMUs", words, AIMS[kind] if count == 200 else None


def seconds(words: Sequence[str]) -> float:
    """Wall time of Python with these arguments, in a folder where nothing is known yet."""
    with tempfile.TemporaryDirectory() as folder:
        begin = perf_counter()
        subprocess.run([sys.executable, *words], check=True, cwd=folder, env=USUAL, stdout=subprocess.DEVNULL)
        return perf_counter() - begin


def parts_table(kinds: dict[str, Path], runs: int) -> Table:
    """Where the time of one run goes, in one process."""
    table = Table(title=f"Milliseconds of a run: median of {runs}, after the first")
    for column in ("FMUs", "read", "load", *PARTS, "rest", "run"):
        table.add_column(column, justify="left" if column == "FMUs" else "right")
    for kind, folder in kinds.items():
        table.add_row(kind, *(f"{1e3 * s:.2f}" for s in parts(folder, runs)))
    return table


def parts(fmus: Path, runs: int) -> tuple[float, ...]:
    """Time to read and load a scenario, of the parts of a run, of what is left, and of the whole run."""
    begin = perf_counter()
    read = prepare(SCENARIO, None, fmus)
    middle = perf_counter()
    with Master(*read) as master:
        loaded = perf_counter()
        run_once(master)
        found = [one_run(master) for _ in range(runs)]
    of_runs = [median(column) for column in zip(*found)]
    return middle - begin, loaded - middle, *of_runs


def one_run(master: Master) -> tuple[float, ...]:
    """Time of each part of a run, of what is left, and of the whole."""
    with timed(master) as spent:
        begin = perf_counter()
        run_once(master)
        whole = perf_counter() - begin
    of_parts = [spent[name] for name in PARTS]
    return *of_parts, whole - sum(of_parts), whole


@contextmanager
def timed(master: Master) -> Iterator[dict[str, float]]:
    """Wall time of some methods meanwhile."""
    spent: dict[str, float] = {}

    def watched(name: str, method: Any) -> Any:
        """The method, with its time taken."""

        def call(*arguments: Any) -> Any:
            """Call it."""
            begin = perf_counter()
            try:
                return method(*arguments)
            finally:
                spent[name] = perf_counter() - begin

        return call

    for name in PARTS:
        setattr(master, name, watched(name, getattr(master, name)))
    try:
        yield spent
    finally:
        for name in PARTS:
            delattr(master, name)


if __name__ == "__main__":
    sys.exit(main())
