"""The studies of the bounded unscented Kalman filter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, study
from gapsense.cli.console import bar, say_written, show
from gapsense.studies import FIGURES

FIGURES["bounded_ukf"] = f"{__package__}.show:run_figure"


@study("ukf-noise")
def ukf_noise(
    seeds: Annotated[int, typer.Option(help="Runs at each level and voltage", min=1, max=10**7)] = 20,
    to: Out = Path("results"),
) -> None:
    """Errors of BoundedUkf over the noise, [UKF] Fig. 8, with the open loop and other filters."""
    from gapsense.report import plot

    from . import errors
    from .show import noise_tables, over_noise

    with bar("runs") as progress:
        found = errors.noise(seeds, progress)
    file = plot.save(over_noise(found, errors.NOISES), to / "ukf_noise.png")
    show(*noise_tables(found, errors.NOISES, seeds))
    say_written(file)


@study("ukf-parameters")
def ukf_parameters(to: Out = Path("results")) -> None:
    """Errors of BoundedUkf with wrong parameters, [UKF] Fig. 9, and with a wrong resistance; landings missed."""
    from gapsense.report import plot

    from .errors import ERRORS, RESISTANCES, parameters, unseen
    from .show import over_errors, parameter_tables, resistance_table, unseen_table

    with bar("runs") as progress:
        found = parameters(progress=progress)
    file = plot.save(over_errors(found, ERRORS), to / "ukf_parameters.png")
    show(*parameter_tables(found, ERRORS, 0.0))
    say_written(file)
    wrong = {}
    for r in RESISTANCES:
        with bar(f"resistance {100 * r:+g} %, runs") as progress:
            wrong[r] = parameters(r, (0.0, ERRORS[-1]), progress)
    show(resistance_table(wrong, ERRORS[-1]))
    with bar("unseen cases, runs") as progress:
        show(unseen_table(unseen(progress=progress)))
