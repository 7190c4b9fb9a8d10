"""The command that tells how large the error of the base step is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli import common as cli
from gapsense.cli import console


@cli.command("converge")
def converge(
    scenario: cli.Scenario,
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    runs: Annotated[int, typer.Option(help="Runs at most, 4 to 16; each takes twice the steps of the one before")] = 6,
    budget: Annotated[
        float, typer.Option(help="Wall time [s] beyond which no further run begins", show_default="none")
    ] = math.inf,
    tolerance: Annotated[float, typer.Option(help="Largest error, as a share of the range of a signal")] = 1e-3,
    keep: Annotated[
        list[str] | None,
        typer.Option(help="Component that keeps its instants, as those with a `sample_time` do", show_default=False),
    ] = None,
    settings: cli.Set = None,
    native: cli.Native = False,
    write: Annotated[
        bool, typer.Option("--write", help="Write what was measured beside the scenario; `check` then reminds no more")
    ] = False,
    export: Annotated[
        Path | None,
        cli.Output.FILE,
        typer.Option(help="CSV or JSON file to write, one row per signal", show_default=False),
    ] = None,
    figure: cli.Picture = None,
) -> None:
    """Run a scenario with its base step halved again and again, and tell the error of each recorded signal.

    Sampled components keep their instants. Exit code 1 if an error is beyond the tolerance at the step that the
    scenario has, or if no signal converges.
    """
    from gapsense.cosim.convergence import check_export
    from gapsense.cosim.coupling import measured_file
    from gapsense.report import convergence, plot

    fmus, source = console.chosen(scenario, fmus, native), cosim.changed(scenario, settings or ())
    if export:
        check_export(export)
    if figure:
        plot.check_file(figure)
    with console.bar("running") as progress:
        found = cosim.converge(
            source, variant, fmus, runs, budget, tolerance, keep or (), write, isolation="process", progress=progress
        )
    console.show(*convergence.shown(found))
    if write:
        console.written(measured_file(cosim.load(source, variant)))
    if export:
        console.written(found.export(export))
    if figure:
        console.written(plot.save(found.plot(), figure))
    raise SystemExit(0 if found.passed else console.FAILED)
