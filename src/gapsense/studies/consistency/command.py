"""Consistency of the smoother's covariances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, bar, show, study, written
from gapsense.studies.monte_carlo.command import Core, Runs, Seed


@study("consistency")
def consistency(
    runs: Runs = 10_000,
    width: Annotated[float, typer.Option(help="Width of the parameter errors in percent", min=0.0)] = 1.0,
    seed: Seed = 1,
    core: Core = "fitted",
    to: Out = Path("results"),
) -> None:
    """Normalised errors of the smoother against its covariances: Figs. 7 and 8 of [RTS]."""
    from gapsense.report import plot
    from gapsense.studies.consistency import errors
    from gapsense.studies.consistency.show import single, squared, summary
    from gapsense.studies.monte_carlo.comparison import studied

    reference = studied(core, seed)
    with bar("running") as progress:
        found = errors.consistency(reference, width / 100.0, runs, progress)
    show(summary(found))
    written(
        plot.save(squared(found), to / "consistency_nees.png"), plot.save(single(found), to / "consistency_nee.png")
    )
