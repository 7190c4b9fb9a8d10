"""The command that identifies the valve from measured records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from gapsense import shipped
from gapsense.cli.common import (
    FAILED,
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
    show,
    written,
)
from gapsense.identification.options import AUTO, CONVENTIONS, FORMS, PLAIN

if TYPE_CHECKING:
    from gapsense.identification.identify import Asked, Finished

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
        typer.Option("--temperature", help="Of each record in degC: 23,60,85", show_default="column `temperature`"),
    ] = None,
    forms: Annotated[str, typer.Option(help=f"What the model may have more: auto, {PLAIN}, {', '.join(FORMS)}")] = AUTO,
    hold: Annotated[
        list[str] | None, typer.Option(help="Parameter that keeps its value, as `coil.turns`", show_default=False)
    ] = None,
    inductance: Annotated[
        Path | None, typer.Option(help="CSV file: gap [mm], inductance [mH], for the gap law", show_default=False)
    ] = None,
    driver: Annotated[
        str | None,
        typer.Option(
            help="What it takes of a recorded command: series=OHM,drop=V, or `fit`; delay=S of the current",
            show_default=False,
        ),
    ] = None,
    accuracy: Annotated[
        str | None,
        typer.Option(
            help="In percent, for the standard errors: voltage=0.5,current=1, or of what is known: stop.upper=2",
            show_default=False,
        ),
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
    starts: Annotated[
        int, typer.Option(min=0, max=10**7, help="Starts of least squares; 0: multi-directional search")
    ] = 6,
    seed: Annotated[int, typer.Option(help="Of the random starts", min=0, max=2**31 - 1)] = 1,
) -> None:
    """Identify a solenoid valve, or a coil, from voltage and current of whole operations, recorded from rest on.

    Where a coil without motion explains the records, it is the result. For a valve the gap law, the stops and the
    relaxed spring have to be known, for no record tells them; inductances or a recorded position give the gap law too,
    and core losses and fringes are found where the evidence is for them. Prints values, standard errors and
    correlations, names what the records do not identify, and with --assume all that was assumed.
    """
    from gapsense.cli.commission import commissioned
    from gapsense.identification.identify import Asked, check_believed, coil_of, finish_coil, finish_valve, read
    from gapsense.identification.measurements.reading import reading
    from gapsense.identification.valve.fit import fit_valve
    from gapsense.identification.valve.gap import find_gap

    if model not in MODELS:
        raise ValueError(f"--model: `{model}` found, one of {', '.join(MODELS)} expected.")
    how = reading(column, voltage, separator, decimal, clipped)
    others = (model, period, temperatures, forms, hold or [], inductance, driver, accuracy)
    if commission:
        commissioned(data, how, check_believed(parameters, others), to, validate or [], figure, assume)
    asked = Asked(data, how, to, validate or [], figure, parameters, assume, *others)
    given = read(asked)
    if model == "solenoid_valve":
        given.ask()
    with bar("looking for motion") as progress:
        coil, told = coil_of(model, given.records, given.known.parameters, period, given.conventions, progress)
    if coil is not None:
        end(asked, finish_coil(asked, given, coil), told)
    given.ask()
    start = find_gap(given.known.parameters, given.records, given.sought, inductance, given.conventions, period)
    given.ask_for(start.parameters, start.sought)
    with bar("identifying") as progress:
        result = fit_valve(start.records, start.parameters, starts, seed, period, progress, *start.more, given.drive)
    end(asked, finish_valve(asked, given, start, result), told)


def end(asked: Asked, result: Finished, told: list[str]) -> NoReturn:
    """Show what was found; ends the command."""
    from gapsense.report import plot

    show(*result.shown, *told)
    written(asked.to)
    if asked.figure is not None:
        written(plot.save(result.figure(), asked.figure))
    raise typer.Exit(0 if result.is_explained else FAILED)
