"""The command that finds all parameters of `Mhe` from one record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Clipped, Column, Decimal, Separator, bar, command, show, written


@command("commission")
def commission(
    data: Annotated[Path, typer.Argument(help="CSV file: time [s], voltage [V], current [A]", show_default=False)],
    parameters: Annotated[Path, typer.Option(help="What is believed of the device, for `Mhe`", show_default=False)],
    to: Annotated[Path, typer.Option("--out", help="Parameter-set file to write")] = Path("commissioned.toml"),
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
) -> None:
    """Find all parameters of a reluctance actuator, core losses included, from one record from rest on.

    Known are the stops and, within a few percent, the gap law, the spring, the mass and the core. Prints values and
    standard errors.
    """
    from gapsense.studies.commissioning import file, fit
    from gapsense.studies.commissioning.show import tables
    from gapsense.studies.identification.transfer import parameters_of, read_values
    from gapsense.studies.records.checks import read_records, reading

    known, given = parameters_of("mhe", parameters), read_values([parameters])
    (record,) = read_records([data], reading(column, "trapezoid", separator, decimal, clipped), needs="rest")
    with bar("commissioning") as progress:
        result = fit.commission(record, known, progress)
    file.write(to, result, given, f"gapsense commission {data.name} --parameters {parameters.name}")
    show(*tables(result, known))
    written(to)
