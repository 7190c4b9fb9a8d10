"""The command that tells what a record can give."""

from __future__ import annotations

from typing import Annotated

import typer

from gapsense.cli.common import Clipped, Column, Data, Decimal, Picture, Separator, command, show, written


@command("inspect")
def inspect(
    data: Data,
    figure: Picture = None,
    period: Annotated[float | None, typer.Option(help="Length of an operation in s", show_default="to rest")] = None,
    resistance: Annotated[
        float | None, typer.Option(help="Of the coil, by a meter, in Ohm", show_default=False)
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
) -> None:
    """Tell what a record of voltage and current can give, before anything is fitted to it."""
    from gapsense.identification.inspection.facts import facts
    from gapsense.identification.inspection.show import inspection_figure, inspection_tables
    from gapsense.identification.measurements.reading import read_records, reading
    from gapsense.identification.show import about
    from gapsense.report import plot

    if figure is not None:
        plot.check_file(figure)
    how = reading(column, separator=separator, decimal=decimal, may_clip=True)
    records = read_records(data, how, needs="samples")
    found = [facts(record, period, clipped) for record in records]
    for record, about_it in zip(records, found):
        show(*inspection_tables(record, about_it, resistance), *about(record))
    if figure is not None:
        written(plot.save(inspection_figure(records, found), figure))
