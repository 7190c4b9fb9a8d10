"""The study of soft landing from cycle to cycle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, Workers, study
from gapsense.cli.console import bar, say_written, show
from gapsense.studies import FIGURES

FIGURES["run_to_run"] = f"{__package__}.figure:run_figure"


@study("run-to-run")
def run_to_run(
    runs: Annotated[int, typer.Option(help="Actuators", min=1, max=10**7)] = 200,
    cycles: Annotated[
        int, typer.Option(help="Cycles of each actuator, unless a condition needs another number", min=2, max=10**7)
    ] = 40,
    seed: Annotated[
        int, typer.Option(help="Seed of actuators and noise; the laws were tuned on 1 and 2", min=0, max=2**31 - 1)
    ] = 5,
    conditions: Annotated[str, typer.Option(help="Separated by commas", show_default="all")] = "",
    laws: Annotated[str, typer.Option(help="Separated by commas", show_default="the laws of each condition")] = "",
    workers: Workers = 2,
    to: Out = Path("results"),
) -> None:
    """Impact speeds of RunToRun and other laws, cycle by cycle, on actuators that were never identified.

    An interrupted study continues where it was: runs already in the folder are not repeated.
    """
    from gapsense.report import plot

    from .comparison import chosen, compared, rows
    from .conditions import CONDITIONS
    from .loops import LAWS
    from .show import figures, tables

    wanted = rows(chosen(conditions, [*CONDITIONS], "--conditions") or [*CONDITIONS], chosen(laws, [*LAWS], "--laws"))
    with bar("actuators") as progress:
        found = compared(wanted, runs, cycles, seed, workers, to / "run_to_run.sqlite", progress)
    show(*tables(found), f"{found.computed} tasks computed now.")
    say_written(*(plot.save(figure, to / f"run_to_run_{name}.png") for name, figure in figures(found).items()))
