"""The command that runs estimators on a measured record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import shipped
from gapsense.cli.common import (
    Clipped,
    Column,
    Decimal,
    Fmus,
    Output,
    Separator,
    bar,
    command,
    tell,
)


@command("estimate")
def estimate(
    data: Annotated[
        Path,
        typer.Argument(
            parser=shipped.record,
            metavar="FILE",
            help="CSV file: time [s], voltage [V], current [A]; `sample_valve.csv` comes with Gapsense",
            show_default=False,
        ),
    ],
    estimator: Annotated[
        str | None, typer.Option(help="Names, with commas", show_default="all whose inputs the record has")
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(
            parser=shipped.record,
            metavar="FILE",
            help="Parameter-set file; each estimator takes the parameters that it has",
            show_default=False,
        ),
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
    offset: Annotated[
        list[str] | None,
        typer.Option(
            help="QUANTITY=VALUE: offset of a sensor, in addition to what is seen at rest", show_default=False
        ),
    ] = None,
    fmus: Fmus = None,
    to: Annotated[
        Path | None, Output.FILE, typer.Option("--out", help="CSV file of the estimates", show_default=False)
    ] = None,
    figure: Annotated[
        Path | None, Output.FILE, typer.Option(help="PNG, PDF or SVG file", show_default="results/<data>_estimates.png")
    ] = None,
) -> None:
    """Run the FMUs of estimators on a measured record and draw their outputs.

    Exit code 1 if the record itself shows that one of them is wrong.
    """
    from gapsense import functions

    with bar("estimating") as progress:
        found = functions.estimate(
            data,
            estimator=estimator,
            parameters=parameters or [],
            column=column or [],
            separator=separator,
            decimal=decimal,
            clipped=clipped,
            offset=offset or [],
            fmus=fmus,
            out=to,
            figure=figure or Path("results") / f"{data.stem}_estimates.png",
            progress=progress,
        )
    tell(found)
