"""The command that writes a scenario as a page in which it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense._os.files import refuse_unwritable
from gapsense.cli import common as cli
from gapsense.cli import console
from gapsense.cli.report import free
from gapsense.problems import InputError


@cli.command("page")
def page(
    scenario: cli.Scenario,
    to: Annotated[
        Path | None,
        cli.Output.FILE,
        typer.Option("--out", help="HTML file", show_default="the name of the scenario, ending in .html"),
    ] = None,
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    settings: cli.Set = None,
    show: Annotated[bool, typer.Option("--open", help="Open it in the browser")] = False,
) -> None:
    """Write one HTML file in which a scenario runs: sliders, plots, metrics. It needs no server and no network.

    The numbers are those of `gapsense run`, bit for bit. `[page]` of the scenario names the values that a
    reader can change. The file is compiled by ziglang (`pip install 'gapsense[native,report]'`).
    """
    from gapsense._os.native import NativeError
    from gapsense.page.page import write_page

    source = cosim.changed(scenario, settings or ())
    to = to or free(Path(cosim.result_file(Path(), scenario, variant, settings or ()).with_suffix(".html").name))
    refuse_unwritable(to)
    try:
        file = write_page(source, to, variant, console.chosen(scenario, fmus, False))
    except NativeError as error:
        raise InputError([str(error)]) from error
    console.written(file)
    if show:
        cli.shown(file)
