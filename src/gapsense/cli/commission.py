"""The command that finds all parameters of `Mhe` from records; `gapsense identify --commission` is the same."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import shipped
from gapsense.cli.common import (
    Assume,
    Clipped,
    Column,
    Data,
    Decimal,
    Picture,
    Separator,
    SetFile,
    Validate,
    bar,
    command,
    tell,
)
from gapsense.identification.options import AUTO, CONVENTIONS


@command("commission")
def commission(
    data: Data,
    parameters: Annotated[
        Path,
        typer.Option(
            parser=shipped.record,
            metavar="FILE",
            help="Parameter set with first guesses for the device, as `Mhe` takes it",
            show_default=False,
        ),
    ],
    assume: Assume = False,
    to: SetFile = Path("commissioned.toml"),
    validate: Validate = None,
    figure: Picture = None,
    voltage: Annotated[str, typer.Option(help=f"Voltage between two samples: auto, {', '.join(CONVENTIONS)}")] = AUTO,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
) -> None:
    """Find all parameters of a reluctance actuator, including core losses, from records that start at rest.

    Known are stops and turns and, within a few percent, the gap law, the spring, the mass and the core. Prints values
    and standard errors; exit code 1 where the model does not explain the records.
    """
    from gapsense import functions

    with bar("commissioning") as progress:
        found = functions.commission(
            data,
            parameters,
            assume=assume,
            validate=validate or [],
            voltage=voltage,
            column=column or [],
            separator=separator,
            decimal=decimal,
            clipped=clipped,
            out=to,
            figure=figure,
            progress=progress,
        )
    tell(found)
