"""The command that tells what a record can give."""

from __future__ import annotations

from typing import Annotated

import typer

from gapsense.cli.common import Clipped, Column, Data, Decimal, Picture, Separator, command, tell


@command("inspect")
def inspect(
    data: Data,
    figure: Picture = None,
    period: Annotated[float | None, typer.Option(help="Length of an operation in s", show_default="to rest")] = None,
    resistance: Annotated[
        float | None, typer.Option(help="Resistance of the coil in Ohm, measured with a meter", show_default=False)
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
) -> None:
    """Show what can be learnt from a record of voltage and current, before anything is fitted."""
    from gapsense import functions

    tell(
        functions.inspect(
            data,
            period=period,
            resistance=resistance,
            column=column or [],
            separator=separator,
            decimal=decimal,
            clipped=clipped,
            figure=figure,
        )
    )
