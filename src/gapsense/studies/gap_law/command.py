"""The command that makes a gap law of measured inductances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Column, command, show, written


@command("gap-law")
def gap_law(
    data: Annotated[
        Path,
        typer.Argument(help="CSV file: gap [mm], inductance [mH], or inductance 100Hz [mH], ...", show_default=False),
    ],
    to: Annotated[Path, typer.Option("--out", help="Parameter-set file to write")] = Path("gap.toml"),
    turns: Annotated[
        float | None, typer.Option(help="Turns of the coil", show_default="of --parameters", min=1e-9)
    ] = None,
    parameters: Annotated[
        Path | None, typer.Option(help="What else is known of the valve", show_default="[SEMERA] Table I")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG, PDF or SVG file", show_default=False)] = None,
    column: Column = None,
) -> None:
    """Make a gap law of the inductance of a coil, measured at known gaps.

    Of several frequencies the lowest is used. The law is linear, has fringes, or is a table, whichever foretells best
    the gaps that are left out; `gapsense identify --parameters gap.toml` goes on from there.
    """
    from gapsense.report import plot
    from gapsense.studies.gap_law import file
    from gapsense.studies.gap_law.choice import best, candidates
    from gapsense.studies.gap_law.show import figure_of, tables
    from gapsense.studies.gap_law.table import names_of, read_inductances
    from gapsense.studies.identification.transfer import parameters_of, read_values

    if figure is not None:
        plot.check_file(figure)
    par = parameters_of("solenoid_valve", parameters)
    turns = turns or float(par.coil_turns)
    measured = read_inductances(data, names_of(column))
    found = candidates(measured.gap, turns**2 / measured.inductance)
    taken, upper = best(found), max(float(par.stop_upper), float(measured.gap[-1]))
    given = read_values([parameters] if parameters else [])
    files = file.write(to, taken.law, turns, upper, given, f"gapsense gap-law {data.name}")
    show(*tables(measured, turns, found, taken))
    written(*files)
    if figure is not None:
        written(plot.save(figure_of(measured, turns, taken), figure))
