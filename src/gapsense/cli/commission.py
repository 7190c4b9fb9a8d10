"""The command that finds all parameters of `Mhe` from records; `gapsense identify --commission` is the same."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from gapsense.identification.options import AUTO, CONVENTIONS

if TYPE_CHECKING:
    from gapsense.identification.measurements.record import Reading


@command("commission")
def commission(
    data: Data,
    parameters: Annotated[
        Path,
        typer.Option(
            parser=shipped.record, metavar="FILE", help="What is believed of the device, for `Mhe`", show_default=False
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
    """Find all parameters of a reluctance actuator, core losses included, from records from rest on.

    Known are stops and turns and, within a few percent, the gap law, the spring, the mass and the core. Prints values
    and standard errors; exit code 1 where the model does not explain the records.
    """
    from gapsense.identification.measurements.reading import reading

    how = reading(column, voltage, separator, decimal, clipped)
    commissioned(data, how, parameters, to, validate or [], figure, assume)


def commissioned(
    data: Sequence[Path],
    how: Reading,
    parameters: Path,
    to: Path,
    validate: Sequence[Path],
    figure: Path | None,
    assume: bool = False,
) -> None:
    """Read, fit, write and show; ends the command."""
    from gapsense.identification.actuator import fit
    from gapsense.identification.actuator.fit import validate_actuator
    from gapsense.identification.actuator.show import (
        PORTS,
        actuator_figure,
        actuator_tables,
        doubts,
        missing,
        write_actuator,
    )
    from gapsense.identification.assumptions import ask
    from gapsense.identification.measurements.reading import read_records
    from gapsense.identification.parameter_set import parameters_of, read_sets
    from gapsense.report import plot

    if figure is not None:
        plot.check_file(figure)
    known, (given, marked) = parameters_of("mhe", parameters), read_sets([parameters])
    lacking = missing(known, {*given} - {*marked})
    if not assume:
        ask(lacking, {port.name: port for port in PORTS.values()}, parameters.name, "the component `Mhe`")
    records, kept = (read_records(files, how, needs="rest") for files in (data, validate))
    with bar("commissioning") as progress:
        result = fit.commission(records, known, progress, doubts(lacking))
    names = " ".join(path.name for path in data)
    write_actuator(to, result, given, f"gapsense commission {names} --parameters {parameters.name}", lacking)
    checks = validate_actuator(result.parameters, kept)
    show(*actuator_tables(result, known, checks, lacking))
    written(to)
    if figure is not None:
        written(plot.save(actuator_figure(result, checks), figure))
    raise typer.Exit(0 if result.is_explained else FAILED)
