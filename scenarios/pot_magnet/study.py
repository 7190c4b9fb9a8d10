"""The study of the hybrid Kalman filter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, study
from gapsense.cli.console import bar, say_written, show
from gapsense.studies import FIGURES

FIGURES["pot_magnet"] = f"{__package__}.figure:run_figure"


@study("hybrid-ekf")
def hybrid_ekf(
    seeds: Annotated[int, typer.Option(help="Runs at each level of noise", min=1, max=10**7)] = 100,
    mismatch: Annotated[float, typer.Option(help="Largest relative error of the filter's parameters")] = 0.05,
    orientation: Annotated[str, typer.Option(help="Orientation of the magnet: consistent or printed")] = "consistent",
    to: Out = Path("results"),
) -> None:
    """RMS deviations of HybridEkf over time, noise and wrong parameters, [HEKF] Figs. 8-11, with the open loop."""
    from gapsense.report import plot

    from . import deviations
    from .show import over_noise, over_time, tables

    with bar("runs") as progress:
        found = deviations.study(orientation, seeds, mismatch, progress)
    figures = {"time": over_time(found), "noise": over_noise(found)}
    files = [plot.save(figure, to / f"hybrid_ekf_{orientation}_{name}.png") for name, figure in figures.items()]
    show(*tables(found, orientation, seeds))
    say_written(*files)
