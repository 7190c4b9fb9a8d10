"""The command that identifies the valve from measured records."""

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
from gapsense.identification.options import AUTO, CONVENTIONS, FORMS, PLAIN

MODELS = (AUTO, "coil", "solenoid_valve")


@command("identify")
def identify(
    data: Data,
    model: Annotated[str, typer.Option(help=f"What was measured: {', '.join(MODELS)}")] = AUTO,
    commission: Annotated[
        bool, typer.Option("--commission", help="All parameters of `Mhe`: the command `gapsense commission`")
    ] = False,
    to: SetFile = Path("valve.toml"),
    parameters: Annotated[
        Path | None,
        typer.Option(
            parser=shipped.record,
            metavar="FILE",
            help="Parameter-set file: what is known, stops, gap law, spring; first guesses",
            show_default=False,
        ),
    ] = None,
    assume: Assume = False,
    validate: Validate = None,
    figure: Picture = None,
    period: Annotated[float | None, typer.Option(help="Length of an operation in s", show_default="to rest")] = None,
    voltage: Annotated[str, typer.Option(help=f"Voltage between two samples: auto, {', '.join(CONVENTIONS)}")] = AUTO,
    temperatures: Annotated[
        str | None,
        typer.Option(
            "--temperature", help="Temperature of each record in degC: 23,60,85", show_default="column `temperature`"
        ),
    ] = None,
    forms: Annotated[
        str, typer.Option(help=f"Extensions that the model may have: auto, {PLAIN}, {', '.join(FORMS)}")
    ] = AUTO,
    hold: Annotated[
        list[str] | None, typer.Option(help="Parameter that keeps its value, as `coil.turns`", show_default=False)
    ] = None,
    inductance: Annotated[
        Path | None, typer.Option(help="CSV file: gap [mm], inductance [mH], for the gap law", show_default=False)
    ] = None,
    driver: Annotated[
        str | None,
        typer.Option(
            help="What a driver takes from a recorded command: series=OHM,drop=V, or `fit`; delay=S of the current",
            show_default=False,
        ),
    ] = None,
    accuracy: Annotated[
        str | None,
        typer.Option(
            help="Accuracies in percent, for standard errors: voltage=0.5,current=1, or of given values: stop.upper=2",
            show_default=False,
        ),
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
    starts: Annotated[
        int, typer.Option(min=0, max=10**7, help="Starts of the least-squares search; 0: multi-directional search")
    ] = 6,
    seed: Annotated[int, typer.Option(help="Seed of the random starts", min=0, max=2**31 - 1)] = 1,
) -> None:
    """Identify a solenoid valve or a coil from voltage and current of complete operations, recorded from rest.

    Where a coil without motion explains the records, it is the result. For a valve the gap law, the stops and the
    relaxed spring have to be known, for no record tells them; inductances or a recorded position give the gap law too,
    and core losses and fringes are found where the evidence is for them. Prints values, standard errors and
    correlations, names what the records do not identify, and with --assume all that was assumed.
    """
    from gapsense import functions

    with bar("identifying") as progress:
        found = functions.identify(
            data,
            model=model,
            commission=commission,
            parameters=parameters,
            assume=assume,
            validate=validate or [],
            period=period,
            voltage=voltage,
            temperature=temperatures,
            forms=forms,
            hold=hold or [],
            inductance=inductance,
            driver=driver,
            accuracy=accuracy,
            column=column or [],
            separator=separator,
            decimal=decimal,
            clipped=clipped,
            starts=starts,
            seed=seed,
            out=to,
            figure=figure,
            progress=progress,
        )
    tell(found)
