"""The commands that write scenarios as SSP, and make scenarios of SSP."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli import common as cli
from gapsense.cosim.scenario import METHODS

Method = Enum("Method", {name: name for name in METHODS}, type=str)


@cli.command("export-ssp")
def export_ssp(
    scenario: cli.Scenario,
    to: Annotated[Path, typer.Option("--out", help="Package to write, with the ending .ssp", show_default=False)],
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    settings: cli.Set = None,
    native: cli.Native = False,
) -> None:
    """Write a scenario as a system structure package (SSP 1.0), which other tools run.

    What SSP has no words for is carried in annotations and told, one sentence each.
    """
    from gapsense.ssp.export import export

    notes = export(cosim.changed(scenario, settings or ()), to, variant, cli.chosen(scenario, fmus, native))
    for note in notes:
        cli.notice(note)
    cli.written(to)
