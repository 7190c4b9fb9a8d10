"""Commands for measured records: identify the valve, run estimators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gapsense.cli.common import bar, command, err, out, reported
from gapsense.studies.identification.fit import STARTS
from gapsense.studies.identification.record import CONVENTIONS, Record

MODELS = ("solenoid_valve",)
Column = Annotated[
    list[str] | None,
    typer.Option(help="QUANTITY=NAME: column, or signal of a result, that holds the quantity", show_default=False),
]
Voltage = Annotated[str, typer.Option(help=f"Voltage between two samples: {', '.join(CONVENTIONS)}")]
Records = Annotated[
    list[Path], typer.Argument(help="CSV files: time [s], voltage [V], current [A]", show_default=False)
]


@command("identify")
def identify(
    data: Records,
    model: Annotated[str, typer.Option(help="What was measured")] = MODELS[0],
    to: Annotated[Path, typer.Option("--out", help="Parameter-set file to write")] = Path("valve.toml"),
    parameters: Annotated[
        Path | None, typer.Option(help="Known parameters and first guesses", show_default="[SEMERA] Table I")
    ] = None,
    validate: Annotated[
        list[Path] | None, typer.Option(help="Record that is kept for the validation", show_default=False)
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG, PDF or SVG file", show_default=False)] = None,
    period: Annotated[float | None, typer.Option(help="Length of an operation in s", show_default="edges")] = None,
    voltage: Voltage = "trapezoid",
    column: Column = None,
    starts: Annotated[int, typer.Option(min=0, help="Starts of least squares; 0: multi-directional search")] = STARTS,
    seed: Annotated[int, typer.Option(help="Of the random starts")] = 1,
) -> None:
    """Identify a solenoid valve from voltage and current, recorded from rest on over whole periods.

    The gap law, the stops and the relaxed spring are taken as known. Prints values, standard errors and correlations,
    and names what the records do not identify.
    """
    from gapsense.report import plot as figures
    from gapsense.studies.identification import file, fit, validation
    from gapsense.studies.identification import show as report

    with reported():
        one_of("--model", model, MODELS)
        if figure is not None:
            figures.check_file(figure)
        known = file.read_known(parameters)
        records = read(data, column, voltage, period, "periods")
        kept = read(validate or [], column, voltage, None, "rest")
        with bar("identifying") as progress:
            result = fit.identify(records, known.parameters, starts, seed, period, progress)
        checks = [validation.validate(result.parameters, record) for record in kept]
        file.write_identified(to, result, known, data)
        shown = [report.resistances(result, records), report.parameters(result), report.correlations(result)]
        for table in (*shown, *([report.validation(checks)] if checks else [])):
            out.print(table)
        for sentence in report.remarks(result):
            out.print(sentence, markup=False)
        out.print(f"{to} written.", markup=False)
        if figure is not None:
            runs = [(r, m, f.operations[0].start) for r, m, f in zip(records, result.models, result.fluxes)]
            out.print(f"{figures.save(report.figure(runs, checks), figure)} written.", markup=False)


@command("estimate")
def estimate(
    data: Annotated[Path, typer.Argument(help="CSV file: time [s], voltage [V], current [A]", show_default=False)],
    estimator: Annotated[
        str | None, typer.Option(help="Names, with commas", show_default="all that the record has the inputs of")
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(help="Parameter-set file; each estimator takes what it has", show_default=False),
    ] = None,
    column: Column = None,
    fmus: Annotated[Path | None, typer.Option(help="Folder of the FMUs", show_default="build/fmus")] = None,
    to: Annotated[Path | None, typer.Option("--out", help="CSV file of the estimates", show_default=False)] = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG, PDF or SVG file", show_default="results/<data>_estimates.png")
    ] = None,
) -> None:
    """Run estimators, through their FMUs, on a measured record, and draw what they say."""
    from gapsense.fmi.components import find_checkout, find_components
    from gapsense.report import plot as figures
    from gapsense.studies.estimation import run as estimation
    from gapsense.studies.estimation import show as report
    from gapsense.studies.identification import transfer

    with reported():
        picture = figure or Path("results") / f"{data.stem}_estimates.png"
        figures.check_file(picture)
        root = find_checkout()
        inputs = estimators(root)
        (record,) = read([data], column, "trapezoid", None, "samples")
        folders = find_components(root / "fmus")
        values = transfer.read_values(parameters or [])
        names = chosen(estimator, inputs, record, {} if estimator else unfit(root, values))
        transfer.taken(find_components(root / "fmus", names), parameters or [], folders)  # refuses before any runs
        estimates = []
        with bar("estimating") as progress:
            for k, name in enumerate(names):
                progress(k, len(names))
                fmu = (fmus or root / "build" / "fmus") / f"{name}.fmu"
                estimates.append(estimation.run_estimator(fmu, record, values))
        out.print(report.values(estimates))
        for e in estimates:
            given = ", ".join(f"{name} = {value:.6g}" for name, value in e.values.items() if not isinstance(value, str))
            out.print(f"{e.name}: {given}", markup=False)
        if to is not None:
            out.print(f"{report.save(to, record, estimates)} written.", markup=False)
        out.print(f"{figures.save(report.figure(record, estimates), picture)} written.", markup=False)


def one_of(option: str, value: str, choices: tuple[str, ...]) -> None:
    """Refuse a value that an option does not have."""
    if value not in choices:
        raise ValueError(f"{option}: `{value}` found, one of {', '.join(choices)} expected.")


def read(files: list[Path], column: list[str] | None, voltage: str, period: float | None, needs: str) -> list[Record]:
    """Records of files; all problems of all files at once."""
    from gapsense.studies.identification.checks import read_record
    from gapsense.studies.identification.record import RecordError

    one_of("--voltage", voltage, CONVENTIONS)
    if wrong := [pair for pair in column or [] if "=" not in pair]:
        raise ValueError(f"--column: `{wrong[0]}` found, QUANTITY=NAME expected, for instance voltage=u1.")
    names = dict(pair.split("=", 1) for pair in column or [])
    records, problems = [], []
    for file in files:
        try:
            records.append(read_record(file, names, voltage, period, needs))
        except RecordError as error:
            problems += error.problems
    if problems:
        raise RecordError(problems)
    return records


def estimators(root: Path, causality: str = "input") -> dict[str, list[str]]:
    """Inputs, or other ports, of every estimator in fmus/."""
    from gapsense.fmi.components import find_components, load_component

    found = [load_component(folder) for folder in find_components(root / "fmus")]
    mine = [c for c in found if c.kernel.startswith("gapsense.estimators.")]
    return {c.name: [port.name for port in c.of(causality)] for c in mine}


def unfit(root: Path, values: dict[str, Any]) -> dict[str, str]:
    """Why estimators do not fit the device that the parameters describe."""
    from gapsense.studies.estimation.run import foreign

    found = {name: foreign(name, own, values) for name, own in estimators(root, "parameter").items()}
    return {name: reason for name, reason in found.items() if reason}


def chosen(wanted: str | None, inputs: dict[str, list[str]], record: Record, unfit: dict[str, str]) -> list[str]:
    """Names of the estimators to run: those wanted, or all that can run and fit; a ValueError says why one cannot."""
    from gapsense.studies.estimation.run import missing

    plain = {name.lower(): name for name in inputs}
    asked = [word.strip().replace("_", "").lower() for word in wanted.split(",")] if wanted else list(plain)
    if unknown := [word for word in asked if word not in plain]:
        raise ValueError(f"--estimator: no estimator `{unknown[0]}`; there are {', '.join(inputs)}.")
    reasons = {name: unfit.get(name) or missing(record, inputs, name) for name in (plain[word] for word in asked)}
    refused = [reason for reason in reasons.values() if reason]
    if refused and (wanted or len(refused) == len(reasons)):
        raise ValueError("\n".join(refused))
    for reason in refused:
        err.print(f"left out: {reason}", style="yellow", markup=False)
    return [name for name, reason in reasons.items() if not reason]
