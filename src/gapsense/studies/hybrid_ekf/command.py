"""The study of the hybrid Kalman filter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import bar, out, reported, study


@study("hybrid-ekf")
def hybrid_ekf(
    seeds: Annotated[int, typer.Option(help="Runs at each level of noise")] = 100,
    mismatch: Annotated[float, typer.Option(help="Largest relative error of the filter's parameters")] = 0.05,
    orientation: Annotated[str, typer.Option(help="Of the magnet: consistent or printed")] = "consistent",
    to: Annotated[Path, typer.Option("--out", help="Folder for the figures")] = Path("results"),
) -> None:
    """RMS deviations of HybridEkf over time, noise and wrong parameters, [HEKF] Figs. 8-11, with the open loop."""
    from gapsense.report import plot as figures
    from gapsense.studies.hybrid_ekf import deviations as numbers
    from gapsense.studies.hybrid_ekf import show as drawings
    from gapsense.studies.hybrid_ekf import text as hybrid_ekf_report

    with reported(), bar("samples") as progress:
        found = numbers.study(orientation, seeds, mismatch, progress)
        drawn = {"time": drawings.over_time(found), "noise": drawings.over_noise(found)}
        files = [figures.save(f, to / f"hybrid_ekf_{orientation}_{name}.png") for name, f in drawn.items()]
    out.print(hybrid_ekf_report.text(found, orientation, seeds), markup=False)
    out.print(f"{' and '.join(map(str, files))} written.", markup=False)
