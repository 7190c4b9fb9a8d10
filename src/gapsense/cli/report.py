"""The command that writes an HTML report on results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import command, notice, written


@command("report")
def report(
    results: Annotated[list[Path], typer.Argument(help="CSV files of saved results", show_default=False)],
    to: Annotated[
        Path | None, typer.Option("--out", help="HTML file", show_default="that of the first result, ending in .html")
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open it in the browser")] = False,
) -> None:
    """Write one HTML file on results: what ran, wiring, plots, metrics, baseline, timing; no server is needed.

    Several results come one below the other, with a table of all of them at the top.
    """
    from gapsense.report.html.page import write_report

    file = write_report(results, to or results[0].with_suffix(".html"))
    written(file)
    if show:
        shown(file)


def shown(file: Path) -> None:
    """Show a file in the browser, or say that there is none: the report is written all the same."""
    import webbrowser

    if not webbrowser.open(file.resolve().as_uri()):
        notice(f"no browser was found here. Open {file} in one yourself.")
