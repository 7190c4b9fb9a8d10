"""The command that identifies the valve from measured records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import FAILED, Clipped, Column, Decimal, Separator, bar, command, show, written
from gapsense.studies.identification.conventions import AUTO, CONVENTIONS

MODELS = ("solenoid_valve",)


@command("identify")
def identify(
    data: Annotated[
        list[Path], typer.Argument(help="CSV files: time [s], voltage [V], current [A]", show_default=False)
    ],
    model: Annotated[str, typer.Option(help="What was measured")] = MODELS[0],
    to: Annotated[Path, typer.Option("--out", help="Parameter-set file to write")] = Path("valve.toml"),
    parameters: Annotated[
        Path | None, typer.Option(help="Known parameters and first guesses", show_default="[SEMERA] Table I")
    ] = None,
    validate: Annotated[
        list[Path] | None, typer.Option(help="Record that is kept for the validation", show_default=False)
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG, PDF or SVG file", show_default=False)] = None,
    period: Annotated[float | None, typer.Option(help="Length of an operation in s", show_default="to rest")] = None,
    voltage: Annotated[str, typer.Option(help=f"Voltage between two samples: auto, {', '.join(CONVENTIONS)}")] = AUTO,
    temperatures: Annotated[
        str | None,
        typer.Option("--temperature", help="Of each record in degC: 23,60,85", show_default="column `temperature`"),
    ] = None,
    inductance: Annotated[
        Path | None, typer.Option(help="CSV file: gap [mm], inductance [mH], for the gap law", show_default=False)
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
    starts: Annotated[int, typer.Option(min=0, help="Starts of least squares; 0: multi-directional search")] = 6,
    seed: Annotated[int, typer.Option(help="Of the random starts")] = 1,
) -> None:
    """Identify a solenoid valve from voltage and current of whole operations, recorded from rest on.

    The gap law, the stops and the relaxed spring are taken as known; inductances or a recorded position give the gap
    law too. Prints values, standard errors and correlations,
    and names what the records do not identify.
    """
    from gapsense.report import plot
    from gapsense.studies.identification import file, fit, gap, guess, temperature, validation
    from gapsense.studies.identification.checks import read_records, reading
    from gapsense.studies.identification.forms import EVERYTHING
    from gapsense.studies.identification.show import measured_and_identified, tables

    if model not in MODELS:
        raise ValueError(f"--model: `{model}` found, one of {', '.join(MODELS)} expected.")
    if figure is not None:
        plot.check_file(figure)
    known = file.read_known(parameters)
    how = reading(column, voltage, separator, decimal, clipped)
    records = temperature.given(temperatures, read_records(data, how, period))
    kept = read_records(validate or [], how, needs="rest")
    guess.check(known.parameters, records, period)
    conventions = CONVENTIONS if voltage == AUTO else ()
    start = gap.known(known.parameters, records, EVERYTHING, inductance, conventions, period)
    with bar("identifying") as progress:
        result = fit.identify(start.records, start.parameters, starts, seed, period, progress, *start.more)
    coefficient, R = temperature.coefficient(records, result.fluxes), result.resistance
    checks = validation.validated(result.parameters, kept, result.convention or voltage, coefficient)
    file.write_identified(to, result, gap.kept(known, result, to), data, temperature.notes(R, coefficient))
    show(*start.told, *tables(result, records, checks), *gap.told(result, start.records))
    show(*temperature.tables(records, R, coefficient))
    written(to)
    if figure is not None:
        written(plot.save(measured_and_identified(result, records, checks), figure))
    raise typer.Exit(0 if result.is_explained else FAILED)
