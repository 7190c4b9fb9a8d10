"""The command that runs estimators on a measured record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import shipped
from gapsense.cli.common import (
    FAILED,
    Clipped,
    Column,
    Decimal,
    Fmus,
    Output,
    Separator,
    bar,
    command,
    problem,
    show,
    written,
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
        str | None, typer.Option(help="Names, with commas", show_default="all that the record has the inputs of")
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(
            parser=shipped.record,
            metavar="FILE",
            help="Parameter-set file; each estimator takes what it has",
            show_default=False,
        ),
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
    offset: Annotated[
        list[str] | None,
        typer.Option(help="QUANTITY=VALUE: what it is off by, beside what it is at rest", show_default=False),
    ] = None,
    fmus: Fmus = None,
    to: Annotated[
        Path | None, Output.FILE, typer.Option("--out", help="CSV file of the estimates", show_default=False)
    ] = None,
    figure: Annotated[
        Path | None, Output.FILE, typer.Option(help="PNG, PDF or SVG file", show_default="results/<data>_estimates.png")
    ] = None,
) -> None:
    """Run estimators, through their FMUs, on a measured record, and draw what they say.

    Exit code 1 if one of them cannot be right, by what the record itself tells.
    """
    from gapsense.cosim.prepare import find_fmus
    from gapsense.fmi.components import components_folder, find_components
    from gapsense.identification import estimate as judge
    from gapsense.identification.estimate import (
        choose_estimators,
        estimate_figure,
        estimate_tables,
        estimators,
        repeat_assumed,
        run_all,
        save,
        subtract_given,
    )
    from gapsense.identification.measurements.prepare import thin
    from gapsense.identification.measurements.reading import read_records, reading
    from gapsense.identification.parameter_set import read_sets, take_values
    from gapsense.identification.show import about
    from gapsense.report import plot

    picture = figure or Path("results") / f"{data.stem}_estimates.png"
    plot.check_file(picture)
    every, folder = components_folder(), fmus or find_fmus(Path("here"))
    record = thin(*read_records([data], reading(column, "end", separator, decimal, clipped), needs="samples"))
    record, (values, assumed) = subtract_given(record, offset or []), read_sets(parameters or [])
    names, left_out = choose_estimators(estimator, estimators(every), record, values)
    for text in (*about(record), *(f"left out: {reason}" for reason in left_out)):
        problem(text, "yellow")
    take_values(find_components(every, names), parameters or [], find_components(every))  # before any run
    with bar("estimating") as progress:
        estimates = run_all([folder / f"{name}.fmu" for name in names], record, values, progress)
    show(*estimate_tables(estimates), *repeat_assumed(values, assumed))
    if to is not None:
        written(save(to, record, estimates))
    written(plot.save(estimate_figure(record, estimates), picture))
    doubts = judge.doubts(record, estimates)
    for text in doubts:
        problem(text)
    raise typer.Exit(FAILED if doubts else 0)
