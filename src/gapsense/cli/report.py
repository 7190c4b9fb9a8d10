"""The command that writes an HTML report on results."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense._os.files import read_bytes, refuse_unwritable
from gapsense.cli import common as cli
from gapsense.cli import console
from gapsense.cli.common import Output, command, open_in_browser
from gapsense.cli.console import say_written
from gapsense.problems import InputError

END = b" - Gapsense</title>"
LOOKED_AT = 10**5  # bytes


@command("report")
def report(
    results: Annotated[list[Path], typer.Argument(help="CSV files of runs or sweeps, folders of campaigns")],
    to: Annotated[
        Path | None,
        Output.FILE,
        typer.Option("--out", help="HTML file", show_default="the name of the first result, ending in .html"),
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open it in the browser")] = False,
) -> None:
    """Write one HTML file about results: what ran, wiring, plots, metrics, baseline, timing. It needs no server.

    Of a sweep or a campaign it has the distribution of each metric, over what was varied, and the worst runs. Several
    results come one below the other, with a table of all of them at the top.
    """
    from gapsense.report.html.page import write_report

    to = page_file(to) if to else free(beside(results[0]))
    refuse_unwritable(to)
    file = write_report(results, to)
    say_written(file)
    if show:
        open_in_browser(file)


def page_file(file: Path) -> Path:
    """Refuse an ending that is not that of a page, such as that of the result or the scenario itself."""
    if file.suffix.lower() not in (".html", ".htm"):
        raise InputError([f"--out: `{file}` found, a file expected that ends in `.html`. Change the ending."])
    return file


def free(file: Path) -> Path:
    """Refuse to replace a file that is no report of Gapsense."""
    if os.path.lexists(file) and END not in read_bytes(file)[:LOOKED_AT]:
        raise InputError(
            [f"{file}: this file exists and is not a Gapsense report. Remove it, or choose another with `--out`."]
        )
    return file


def beside(result: Path) -> Path:
    """File of the report on a result, or on a folder, where none is named."""
    folder = result.resolve()
    return folder.with_name(f"{folder.name}.html") if result.is_dir() else result.with_suffix(".html")


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
    own = cosim.result_file(Path(), scenario, variant, settings or ())
    to = page_file(to) if to else free(Path(own.with_suffix(".html").name))
    refuse_unwritable(to)
    try:
        file = write_page(source, to, variant, console.choose_fmus(scenario, fmus, False))
    except NativeError as error:
        raise InputError([str(error)]) from error
    console.say_written(file)
    if show:
        cli.open_in_browser(file)
