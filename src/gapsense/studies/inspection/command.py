"""The command that tells what a record can give."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Clipped, Column, Decimal, Separator, command, show, written


@command("inspect")
def inspect(
    data: Annotated[Path, typer.Argument(help="CSV file: time [s], voltage [V], current [A]", show_default=False)],
    figure: Annotated[Path | None, typer.Option(help="PNG, PDF or SVG file", show_default=False)] = None,
    period: Annotated[float | None, typer.Option(help="Length of an operation in s", show_default="to rest")] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
) -> None:
    """Tell what a record of voltage and current can give, before anything is fitted to it."""
    from gapsense.report import plot
    from gapsense.studies.identification.checks import read_records, reading
    from gapsense.studies.identification.show import about
    from gapsense.studies.inspection.facts import facts
    from gapsense.studies.inspection.show import figure_of, tables

    if figure is not None:
        plot.check_file(figure)
    how = reading(column, separator=separator, decimal=decimal, may_clip=clipped)
    (record,) = read_records([data], how, needs="samples")
    found = facts(record, period)
    show(*tables(record, found), *about(record))
    if figure is not None:
        written(plot.save(figure_of(record, found), figure))
