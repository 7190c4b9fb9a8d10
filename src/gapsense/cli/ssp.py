"""The commands that write scenarios as SSP, and make scenarios of SSP."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli import common as cli
from gapsense.cli import console

Method = Enum("Method", {"gauss-seidel": "gauss-seidel", "jacobi": "jacobi"}, type=str)


@cli.command("export-ssp")
def export_ssp(
    scenario: cli.Scenario,
    to: Annotated[Path, cli.Output.FILE, typer.Option("--out", help="Package to write, with the ending .ssp")],
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    settings: cli.Set = None,
    native: cli.Native = False,
) -> None:
    """Write a scenario as a system structure package (SSP 1.0), which other tools run.

    What SSP cannot express is stored in annotations, and a note says so for each.
    """
    from gapsense.ssp.export import export

    notes = export(cosim.changed(scenario, settings or ()), to, variant, console.choose_fmus(scenario, fmus, native))
    for note in notes:
        console.notice(note)
    console.say_written(to)


@cli.command("import-ssp")
def import_ssp(
    package: Annotated[Path, typer.Argument(help="System structure package (.ssp)")],
    to: Annotated[Path, cli.Output.FOLDER, typer.Option("--out", help="Folder to make")],
    step: Annotated[
        float | None, typer.Option(help="Base step [s]", show_default="from annotations of known tools")
    ] = None,
    stop: Annotated[float | None, typer.Option(help="End of the run [s]", show_default="as in the package")] = None,
    method: Annotated[
        Method | None, typer.Option(help="Coupling", show_default="from Gapsense's annotation, else jacobi")
    ] = None,
) -> None:
    """Make a scenario from a system structure package (SSP 1.0) of any tool.

    If anything in the package is wrong or not supported, all of it is listed and nothing is written.
    """
    from gapsense.ssp.bring import bring

    for note in bring(package, to, step, stop, method.value if method else None):
        console.notice(note)
    console.show(f"{to / 'scenario.toml'} written. Go on with `gapsense run {to}`.")
