"""The command that makes a gap law of measured inductances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Assume, Column, Picture, SetFile, command, tell


@command("gap-law")
def gap_law(
    data: Annotated[
        Path,
        typer.Argument(help="CSV file: gap [mm], inductance [mH], or inductance 100Hz [mH], ...", show_default=False),
    ],
    to: SetFile = Path("gap.toml"),
    turns: Annotated[
        float | None, typer.Option(help="Turns of the coil", show_default="of --parameters", min=1e-9)
    ] = None,
    parameters: Annotated[Path | None, typer.Option(help="What else is known of the valve", show_default=False)] = None,
    assume: Assume = False,
    figure: Picture = None,
    column: Column = None,
) -> None:
    """Make a gap law from inductances of a coil that were measured at known gaps.

    Of several frequencies the lowest is used. The law is linear, has fringes, or is a table, whichever foretells best
    the gaps that are left out; `gapsense identify --parameters gap.toml` goes on from there.
    """
    from gapsense import functions

    tell(
        functions.gap_law(
            data,
            turns=turns,
            parameters=parameters,
            assume=assume,
            column=column or [],
            out=to,
            figure=figure,
        )
    )
