"""The studies of the bounded unscented Kalman filter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import bar, out, reported, study

Folder = Annotated[Path, typer.Option("--out", help="Folder for the figure")]


@study.command("ukf-noise")
def ukf_noise(
    seeds: Annotated[int, typer.Option(help="Runs at each level and voltage", min=1)] = 20,
    to: Folder = Path("results"),
) -> None:
    """Errors of BoundedUkf over the noise, [UKF] Fig. 8, with the open loop and other filters."""
    from gapsense.report import bounded_ukf as drawings
    from gapsense.report import figures
    from gapsense.studies import bounded_ukf, bounded_ukf_report

    with reported(), bar("samples") as progress:
        found = bounded_ukf.noise(seeds, progress)
        file = figures.save(drawings.over_noise(found, bounded_ukf.NOISES), to / "ukf_noise.png")
    out.print(bounded_ukf_report.noise_text(found, bounded_ukf.NOISES, seeds), markup=False)
    out.print(f"{file} written.", markup=False)


@study.command("ukf-parameters")
def ukf_parameters(to: Folder = Path("results")) -> None:
    """Errors of BoundedUkf with wrong parameters, [UKF] Fig. 9, and with a wrong resistance; landings missed."""
    from gapsense.report import bounded_ukf as drawings
    from gapsense.report import figures
    from gapsense.studies import bounded_ukf, bounded_ukf_report

    errors = bounded_ukf.ERRORS
    with reported():
        with bar("samples") as progress:
            found = bounded_ukf.parameters(progress=progress)
        file = figures.save(drawings.over_errors(found, errors), to / "ukf_parameters.png")
        out.print(bounded_ukf_report.parameter_text(found, errors, 0.0), markup=False)
        out.print(f"{file} written.\n", markup=False)
        wrong = {}
        for r in bounded_ukf.RESISTANCES:
            with bar(f"resistance {100 * r:+g} %, samples") as progress:
                wrong[r] = bounded_ukf.parameters(r, (0.0, errors[-1]), progress)
        out.print(bounded_ukf_report.resistance_text(wrong, errors[-1]), markup=False)
        with bar("unseen cases, samples") as progress:
            found = bounded_ukf.unseen(progress=progress)
        out.print(f"\n{bounded_ukf_report.unseen_text(found)}", markup=False)
