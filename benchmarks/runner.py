"""What a step of a component costs in our runner and in others: `python benchmarks/runner.py --help`.

Prints microseconds per component-step for the scenario semera_valve, and the time of each FMU alone.
Bounds that are missed are said at the end.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bounds import hold
from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

import gapsense

HERE = Path(__file__).resolve().parent
MEASURED = {**os.environ, "PYTHONPATH": str(Path(gapsense.__file__).resolve().parents[1])}
CONSOLE = Console(width=120) if not sys.stdout.isatty() else Console()
# name in measure.py, title, which own time is its FMUs', whose results it must have
ROWS = (
    ("gapsense", "gapsense.cosim", "own_time", "gapsense"),
    ("gapsense_jacobi", "gapsense.cosim, Jacobi", "own_time", "gapsense_jacobi"),
    ("fmpy_loop", "fmpy, setReal/getReal per variable", "own_time", "gapsense"),
    ("simulate_ssp", "fmpy simulate_ssp", "own_time", "gapsense_jacobi"),
    ("libcosim", "libcosimpy, step(n)", "own_time", "gapsense_jacobi"),
    ("cofmupy", "cofmupy", "own_time", "gapsense"),
    ("container", "fmu_manipulation_toolbox container", "own_time", "gapsense"),
    ("container_100", "  the same, 100 steps per call", "own_time", "gapsense"),
    ("own_time", "the FMUs alone: loop in C, raw calls only", "", "gapsense"),
    ("kernels", "the kernels alone: Python calls, no FMI", "", "gapsense"),
    ("gapsense_real_rates", "gapsense.cosim, scenario as it is", "own_time_real_rates", "gapsense_real_rates"),
    ("own_time_real_rates", "  its FMUs alone: loop in C", "", "gapsense_real_rates"),
)
PEERS = ("fmpy_loop", "simulate_ssp", "libcosim", "cofmupy", "container", "container_100")
CAPTION = """All rows but the last two: six components, all with steps of 50 us from t = 0, edges of the drive half-way
between two steps, 8100 steps, since the peers know no offsets. Loading and initialisation do not count.
Overhead: less the FMUs' own time, which is that of a loop in C with one set, do_step and get per component-step.
fmpy per variable and the container exchange as gapsense.cosim does (Gauss-Seidel: inputs of this step); simulate_ssp
and libcosim are Jacobi (inputs one step old, hence other values; simulate_ssp also starts with zeros instead of the
initial outputs). Deviation: largest relative difference of five last outputs to gapsense.cosim with the same exchange.
libcosim and the containers record nothing meanwhile, cofmupy all outputs, gapsense.cosim all signals of the scenario
at each step. cofmupy has its own environment, .venv-cofmupy: it wants another fmpy than we do.
Aims: ahead of all peers, below 6 us; overhead of gapsense.cosim below 0.1 us."""
ALONE = """Loop in C over one component at a time, on the inputs of the experiment above; the kernel as plain Python on
the same inputs. In the whole scenario a step takes longer, as caches are shared. Aim: semera do_step below 2.7 us."""
ACTUATOR = """Loop in C over one component at a time, on the inputs of benchmarks/actuator, of scenarios/pot_magnet
(variant off) and of scenarios/bounded_ukf; median of all steps. Aims: do_step of Ekf below 5.1 and 6.3, of HybridEkf
below 2.8 and 4.9, of BoundedUkf below 11.2 us."""


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, help="measurements of each row, interleaved")
    parser.add_argument("--fmus", type=Path, default=HERE.parent / "build" / "fmus", help="folder of the FMUs")
    options = parser.parse_args()
    options.fmus = options.fmus.resolve()  # measurements run in another folder
    if not any(options.fmus.glob("*.fmu")):
        print(f"{options.fmus}: no FMUs in this folder. Build them: python build_fmus.py", file=sys.stderr)
        return 2
    names = [row[0] for row in ROWS] + ["alone", "actuator"]
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    jobs = [name for _ in range(max(1, options.repeats)) for name in names]
    for name in track(jobs, "Measuring", console=Console(stderr=True), transient=True):
        found[name].append(measured(name, options.fmus))
    tables = (
        (row_table(found), CAPTION),
        (alone_table(found["alone"]), ALONE),
        (actuator_table(found["actuator"]), ACTUATOR),
    )
    for table, caption in tables:
        CONSOLE.print(table)
        CONSOLE.print(caption + "\n", style="dim", soft_wrap=True, highlight=False)
    totals = {name: median_of(answers) for name, answers in found.items()}
    hold("gapsense.cosim, Python FMUs", totals["gapsense"], 6.0, "us per component-step")
    for peer in PEERS:
        if totals[peer] < float("inf"):
            hold(f"gapsense.cosim against {peer}", totals["gapsense"], totals[peer], "us per component-step")
    return 0


def median_of(answers: Sequence[Mapping[str, Any]]) -> float:
    """Of the microseconds of a row; infinite without any."""
    return statistics.median([a["microseconds"] for a in answers if "microseconds" in a] or [float("inf")])


def measured(name: str, fmus: Path) -> dict[str, Any]:
    """One measurement in a fresh process: its answer, or what went wrong."""
    command = [sys.executable, str(HERE / "measure.py"), name, str(fmus)]
    with tempfile.TemporaryDirectory() as folder:  # peers leave files behind
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, env=MEASURED)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    words = (done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"])[-1]
    answer: dict[str, Any] = json.loads(lines[-1]) if lines else {"failed": words[:60]}
    return answer


def spread(values: Sequence[float]) -> str:
    """Median (min to max)."""
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})" if values else "-"


def row_table(found: Mapping[str, list[dict[str, Any]]]) -> Table:
    """The masters beside each other."""
    table = Table(title="Microseconds per component-step: median (min to max)")
    for column in ("", "total", "overhead", "semera.resistance", "deviation"):
        table.add_column(column, justify="right" if column else "left")
    for name, title, own, like in ROWS:
        good = [answer for answer in found[name] if "microseconds" in answer]
        if not good:
            table.add_row(title, reason(found[name][-1]))
            continue
        floor = [answer["microseconds"] for answer in found.get(own, []) if "microseconds" in answer]
        times = [answer["microseconds"] for answer in good]
        overhead = f"{statistics.median(times) - statistics.median(floor):.2f}" if floor else "-"
        last = good[-1]["last"]
        table.add_row(
            title, spread(times), overhead, f"{last['semera.resistance']:.6f}", deviation(last, found.get(like, []))
        )
    return table


def reason(answer: Mapping[str, str]) -> str:
    """Why there is no number."""
    if "missing" in answer:
        return f"not installed ({answer['missing']}): pip install -e .\\[peers]"
    return escape(f"failed: {answer.get('failed')}")


def deviation(last: Mapping[str, float], ours: list[dict[str, Any]]) -> str:
    """Largest relative difference to our result."""
    good = [answer["last"] for answer in ours if "last" in answer]
    if not good:
        return "-"
    return f"{max(abs(v - good[0][n]) / (abs(good[0][n]) or 1.0) for n, v in last.items()):.1g}"


def actuator_table(answers: list[dict[str, Any]]) -> Table:
    """The reluctance actuator, and the estimators with a model."""
    table = Table(title="do_step of the reluctance actuator and of estimators with a model: microseconds")
    for column in ("", "at rest", "in motion"):
        table.add_column(column, justify="right" if column else "left")
    good = [answer["actuator"] for answer in answers if "actuator" in answer]
    for name in good[0] if good else ():
        table.add_row(name, *(spread([answer[name][i] for answer in good]) for i in range(2)))
    if not good:
        table.add_row("failed", str(answers[-1].get("failed") or reason(answers[-1])))
    return table


def alone_table(answers: list[dict[str, Any]]) -> Table:
    """Each FMU and its kernel."""
    table = Table(title="Each FMU alone: microseconds per step")
    for column in ("", "set", "do_step", "get", "kernel"):
        table.add_column(column, justify="right" if column else "left")
    good = [answer["alone"] for answer in answers if "alone" in answer]
    for name in good[0] if good else ():
        table.add_row(name, *(spread([answer[name][i] for answer in good]) for i in range(4)))
    if not good:
        table.add_row("failed", str(answers[-1].get("failed") or reason(answers[-1])))
    return table


if __name__ == "__main__":
    sys.exit(main())
