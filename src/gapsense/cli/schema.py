"""The command that writes the JSON schema of scenario files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Output, command, show, written


@command("schema")
def schema(
    to: Annotated[
        Path | None, Output.FILE, typer.Option("--out", help="File to write", show_default="print it")
    ] = None,
) -> None:
    """Show or write the JSON schema of scenario files, by which editors complete and check them.

    Name it in the first line of a scenario: `#:schema scenario.schema.json`.
    """
    from gapsense._os.files import write_atomically
    from gapsense.report import reference

    text = json.dumps(reference.schema(), indent=2)
    if to is None:
        return show(text)
    write_atomically(to, lambda file: print(text, file=file))
    written(to)
