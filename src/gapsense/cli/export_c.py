"""The command that writes components as C for microcontrollers."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Output, command
from gapsense.cli.components import Root
from gapsense.cli.console import say_written, show
from gapsense.fmi.values import ValuesError, fields, unknown_parameter
from gapsense.problems import InputError
from gapsense.tables import Value

Real = Enum("Real", {"float": "float", "double": "double"}, type=str)
FLOAT = Real("float")


@command("export-c")
def export_c(
    names: Annotated[list[str], typer.Argument(help="Components, see `gapsense list`")],
    to: Annotated[Path, Output.FOLDER, typer.Option("--out", help="Folder to write to")],
    real: Annotated[Real, typer.Option(help="Type of all numbers")] = FLOAT,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            help="Outputs, separated by commas; nothing else is computed", show_default="all outputs of a component"
        ),
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(help="Parameter-set file of start values; each component takes the parameters that it has"),
    ] = None,
    settings: Annotated[list[str] | None, typer.Option("--set", help="PARAMETER=VALUE: another start value")] = None,
    bake: Annotated[bool, typer.Option("--bake", help="Make the parameters constants of the code")] = False,
    lean: Annotated[
        bool, typer.Option("--lean", help="Use the form with fewer operations, whose rounding differs (semera only)")
    ] = False,
    loop: Annotated[
        bool, typer.Option("--loop", help="Add the program of a board that is a component of a co-simulation")
    ] = False,
    ram: Annotated[
        int | None, typer.Option(help="Bytes of RAM that the part has: what does not fit is refused", min=1)
    ] = None,
    root: Root = None,
) -> None:
    """Write components as C99 for microcontrollers: source, header, a working example and a README."""
    from gapsense.embedded.design import check_lean, check_outputs, make_design
    from gapsense.embedded.export import export
    from gapsense.fmi.components import components_folder, find_components

    every = components_folder(root)
    folders = [*dict.fromkeys(find_components(every, names))]
    wanted = [name.strip() for text in outputs or () for name in text.split(",") if name.strip()]
    check_outputs(folders, wanted)
    if lean:
        check_lean(folders)
    values = read_start_values(folders, find_components(every), parameters or (), settings or ())
    designs = [make_design(folder, real.value, wanted, values[folder], bake, lean) for folder in folders]
    for design in designs:
        show(f"{design.name:20} {', '.join(design.kept['outputs'])}")
    files = export(designs, to, loop, ram or 0)
    say_written(*(file for file in files if file.suffix in (".c", ".h") and file.parent == to), to / "README.md")


def read_start_values(
    folders: Sequence[Path], known: Sequence[Path], files: Sequence[Path], settings: Sequence[str]
) -> dict[Path, dict[str, Value]]:
    """Read the start values that each component gets: from the files, and over them the settings."""
    from gapsense.cosim.scenario.read import read_settings
    from gapsense.fmi.components import load_component
    from gapsense.identification.parameter_set import take_values

    values = take_values(folders, files, known) if files else {folder: {} for folder in folders}
    names = {folder: {port.name for port in load_component(folder).of("parameter")} for folder in folders}
    problems: list[str] = []
    changes, every = read_settings(settings, "parameter", problems), set().union(*names.values())
    problems += [f"--set: {unknown_parameter(name, every)}" for name in changes if name not in every]
    for folder in folders:
        values[folder] = {**values[folder], **{name: v for name, v in changes.items() if name in names[folder]}}
        try:
            fields(load_component(folder), values[folder], folder)
        except ValuesError as error:
            problems += [f"{folder.name}: {problem}" for problem in error.problems]
    if problems:
        raise InputError(problems)
    return values
