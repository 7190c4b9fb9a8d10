"""The command that identifies the valve from measured records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gapsense.cli.common import FAILED, Clipped, Column, Decimal, Separator, bar, command, show, written
from gapsense.studies.records.conventions import AUTO, CONVENTIONS, FORMS, PLAIN

if TYPE_CHECKING:
    from gapsense.studies.identification.coil.fit import Coil
    from gapsense.studies.identification.valve.file import Known
    from gapsense.studies.identification.valve.fit import Identified
    from gapsense.studies.identification.valve.gap.start import Gap
    from gapsense.studies.records.record import Record

MODELS = (AUTO, "coil", "solenoid_valve")


@command("identify")
def identify(
    data: Annotated[
        list[Path], typer.Argument(help="CSV files: time [s], voltage [V], current [A]", show_default=False)
    ],
    model: Annotated[str, typer.Option(help=f"What was measured: {', '.join(MODELS)}")] = AUTO,
    commission: Annotated[
        bool, typer.Option("--commission", help="All parameters of `Mhe`: the command `gapsense commission`")
    ] = False,
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
            help="Of the scales, in percent, for the standard errors: voltage=0.5,current=1", show_default=False
        ),
    ] = None,
    column: Column = None,
    separator: Separator = ",",
    decimal: Decimal = ".",
    clipped: Clipped = False,
    starts: Annotated[int, typer.Option(min=0, help="Starts of least squares; 0: multi-directional search")] = 6,
    seed: Annotated[int, typer.Option(help="Of the random starts")] = 1,
) -> None:
    """Identify a solenoid valve, or a coil, from voltage and current of whole operations, recorded from rest on.

    Where a coil without motion explains the records, it is the result. For a valve the gap law, the stops and the
    relaxed spring are taken as known; inductances or a recorded position give the gap law too, and core losses and
    fringes are found where the evidence is for them. Prints values, standard errors and correlations, and names what
    the records do not identify.
    """
    from gapsense.report import plot
    from gapsense.studies.commissioning.command import commissioned
    from gapsense.studies.identification import choice, temperature
    from gapsense.studies.identification.options import believed, sought
    from gapsense.studies.identification.valve import drive, file, fit, known_gap
    from gapsense.studies.records.checks import read_records, reading
    from gapsense.studies.records.record import between

    if model not in MODELS:
        raise ValueError(f"--model: `{model}` found, one of {', '.join(MODELS)} expected.")
    if figure is not None:
        plot.check_file(figure)
    how = reading(column, voltage, separator, decimal, clipped)
    if commission:
        others = (model, period, temperatures, forms, hold, inductance, driver, accuracy)
        commissioned(data, how, believed(parameters, others), to, validate or [], figure)
    known, drive_at = file.read_known(parameters), drive.drive_of(driver, accuracy)
    seeking = sought(forms, hold or [], known)
    records = temperature.given(temperatures, read_records(data, how, period))
    records = [record._replace(drive=drive_at.values) for record in records]
    kept = read_records(validate or [], how, needs="rest")
    conventions = CONVENTIONS if voltage == AUTO and not all(record.is_mean for record in records) else ()
    with bar("looking for motion") as progress:
        coil, told = choice.coil_of(model, records, known.parameters, period, conventions, progress)
    if coil is not None:
        kept = [record._replace(drive=drive_at.values) for record in kept]
        finish_coil(coil, known.parameters.coil_turns if parameters else 0.0, kept, to, data, figure, told)
    start = known_gap.known(known.parameters, records, seeking, inductance, conventions, period)
    with bar("identifying") as progress:
        result = fit.identify(start.records, start.parameters, starts, seed, period, progress, *start.more, drive_at)
    kept = [between(record._replace(drive=result.drive), result.convention or voltage) for record in kept]
    finish_valve(result, start, known, kept, to, data, figure, told)


def finish_valve(
    result: Identified,
    start: Gap,
    known: Known,
    kept: list[Record],
    to: Path,
    data: list[Path],
    figure: Path | None,
    told: list[str],
) -> None:
    """Write and show a valve; ends the command."""
    from gapsense.report import plot
    from gapsense.studies.identification import temperature
    from gapsense.studies.identification.noise import noises
    from gapsense.studies.identification.valve import drive, file, validation
    from gapsense.studies.identification.valve.gap import result as gap
    from gapsense.studies.identification.valve.show import measured_and_identified, tables

    records, R = start.records, result.resistance
    coefficient = temperature.coefficient(records, result.fluxes)
    checks = validation.validated(result.parameters, kept, coefficient)
    notes = [*drive.notes(result.drive), *temperature.notes(R, coefficient)]
    file.write_identified(to, result, gap.kept(known, result, to), data, noises(records), notes)
    show(*start.told, *tables(result, records, checks), *gap.told(result, records))
    doubts = drive.doubtful(R, known.resistance)
    show(*temperature.tables(records, R, coefficient), *told, *doubts)
    written(to)
    if figure is not None:
        written(plot.save(measured_and_identified(result, records, checks), figure))
    raise typer.Exit(0 if result.is_explained and not doubts else FAILED)


def finish_coil(
    result: Coil,
    turns: float,
    kept: list[Record],
    to: Path,
    data: list[Path],
    figure: Path | None,
    told: list[str],
) -> None:
    """Write and show a coil; ends the command."""
    from gapsense.report import plot
    from gapsense.studies.identification.coil import file, validation
    from gapsense.studies.identification.coil import show as shown
    from gapsense.studies.identification.valve.prepared import without_causes

    kept = [without_causes(record, result.convention) for record in kept]
    checks = [validation.validate(result, record) for record in kept]
    file.write(to, result, turns, data)
    show(*shown.tables(result, turns, checks), *told)
    written(to)
    if figure is not None:
        written(plot.save(shown.measured_and_identified(result, checks), figure))
    raise typer.Exit(0 if result.is_explained else FAILED)
