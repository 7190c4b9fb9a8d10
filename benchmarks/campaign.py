"""What a campaign costs: `python benchmarks/campaign.py --help`.

A thousand runs of semera_valve on local processes: how busy the processors are, and how much memory is used on the way.
Then a result of a million rows, made by the same writer: how long its summary, its figure and
a report on it take, and how much memory.
Nothing is asserted: the aims stand beside what was measured.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, process_time, sleep
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import gapsense
from gapsense.cosim.scenario.read import CAMPAIGN_FILE
from gapsense.many.campaign import about_of
from gapsense.many.columns import Columns, contents
from gapsense.many.prepare import prepare
from gapsense.many.result import KEY, read_campaign
from gapsense.many.store import Store

ROOT = Path(__file__).resolve().parents[1]
STUDY = ROOT / "scenarios" / "semera_valve" / "tolerances.toml"
OURS = {**os.environ, "PYTHONPATH": str(Path(gapsense.__file__).resolve().parents[1])}
CONSOLE = Console(width=110) if not sys.stdout.isatty() else Console()
GROUP = 1000  # rows that are appended at once


def gapsense_process(*arguments: object) -> subprocess.Popen[bytes]:
    """The command line, in a process of its own."""
    command = [sys.executable, "-m", "gapsense.cli", *map(str, arguments)]
    return subprocess.Popen(command, env=OURS, stdout=subprocess.DEVNULL)


def memory(pid: int) -> dict[int, float]:
    """Resident memory [MB] of a process and of those that it has started."""
    tasks = Path(f"/proc/{pid}/task")
    children = [int(child) for task in tasks.iterdir() for child in (task / "children").read_text().split()]
    return {p: int(Path(f"/proc/{p}/statm").read_text().split()[1]) * 4096 / 1e6 for p in (pid, *children)}


def busy(folder: Path, workers: int) -> tuple[dict[str, str], str]:
    """The thousand runs: what was measured, by what it is."""
    begun, before = perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process, seen = gapsense_process("campaign", STUDY, "--workers", workers, "--out", folder), []
    while process.poll() is None:
        sleep(0.5)
        try:
            seen.append(memory(process.pid))
        except OSError:  # one of them has just ended
            continue
    wall, after = perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    whole = [m for m in seen if len(m) == workers + 1]
    early, late = (sum(whole[k].values()) for k in (len(whole) // 5, -2))
    count = read_campaign(folder).rows
    share = 100 * spent / wall / workers
    return {
        f"{count} runs on {workers} processes": f"{wall:.1f} s, {1e3 * wall / max(count, 1):.1f} ms per run",
        "processors busy (aim: 90 % or more)": f"{share:.0f} % of {workers}, start and end included",
        "memory of all processes, after a fifth and at the end (aim: the same)": f"{early:.0f} MB, {late:.0f} MB",
    }, "Load of the machine beside it counts against it"


def synthetic(folder: Path, rows: int) -> float:
    """Write a result of so many rows through the writer of campaigns; the time [s]."""
    prepared = prepare(STUDY)
    columns, random, begun = prepared.many.columns, np.random.default_rng(1), perf_counter()
    with Store(folder / CAMPAIGN_FILE, KEY) as store:
        store.describe({**about_of(prepared, folder), "runs": rows, "points": rows})
        for first in range(0, rows, GROUP):
            store.add(*contents(columns, [entry(first + k, columns, random) for k in range(min(GROUP, rows - first))]))
    return perf_counter() - begun


def entry(run: int, columns: Columns, random: np.random.Generator) -> dict[str, Any]:
    """A run as a worker might have answered it."""
    x = dict(zip(columns.factors, random.normal(size=len(columns.factors)).tolist()))
    noise, base = random.normal(size=len(columns.metrics)).tolist(), sum(x.values())
    asked = {"index": run, "shift": run, "values": x}
    if run % 9973 == 0:
        return {**asked, "error": "valve, t = 0.01 s (base step 400): it is stuck."}
    return {
        **asked,
        "metrics": {n: math.exp(0.2 * base + 0.1 * e) for n, e in zip(columns.metrics, noise)},
        "wall": 0.05,
    }


def column_read(folder: Path) -> str:
    """Time to read one column."""
    result = read_campaign(folder)
    begun, spent = perf_counter(), process_time()
    result.column(result.metrics[0])
    return f"{perf_counter() - begun:.2f} s, {process_time() - spent:.2f} s of a processor"


def looked_at(folder: Path, command: Sequence[str], *options: object) -> str:
    """Time and memory of a command on a result."""
    begun = perf_counter()
    process = gapsense_process(*command, folder, *options)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"gapsense {' '.join(command)} ended with exit code {process.returncode}")
    spent = f"{used.ru_utime + used.ru_stime:.1f} s of processors"
    return f"{perf_counter() - begun:.1f} s, {spent}, at most {used.ru_maxrss / 1e3:.0f} MB"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rows", type=int, default=10**6, help="of the synthetic result")
    parser.add_argument("--only-rows", action="store_true", help="leave the thousand runs out")
    chosen = parser.parse_args()
    table = Table("what", "measured", title="Campaigns")
    with tempfile.TemporaryDirectory() as place:
        if not chosen.only_rows:
            measured, caption = busy(Path(place, "runs"), chosen.workers)
            table.caption = caption
            for what, value in measured.items():
                table.add_row(what, value)
        folder = Path(place, "rows")
        seconds = synthetic(folder, chosen.rows)
        size = sum(file.stat().st_size for file in folder.glob("*.sqlite")) / 1e6
        table.add_row(f"{chosen.rows} rows written", f"{seconds:.1f} s, {size:.0f} MB on the disk")
        table.add_row("a column of them (aim: 0.4 s)", column_read(folder))
        table.add_row("summary of them (aim: below 4 s)", looked_at(folder, ("campaign", "show")))
        table.add_row(
            "figure of them (aim: below 10 s)", looked_at(folder, ("campaign", "figure"), "--out", Path(place, "x.png"))
        )
        table.add_row("report on them", looked_at(folder, ("report",), "--out", Path(place, "x.html")))
    CONSOLE.print(table)


if __name__ == "__main__":
    main()
