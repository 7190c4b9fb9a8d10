"""Commands for components: build them, list them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import checkout, command, show
from gapsense.report import runs


@command("build")
def build(
    names: Annotated[
        list[str] | None, typer.Argument(help="Components; all if none is named", show_default=False)
    ] = None,
    to: Annotated[Path | None, typer.Option("--out", help="Where to write them", show_default="build/fmus")] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(help="Parameter-set file of start values; each FMU takes those it has", show_default=False),
    ] = None,
) -> None:
    """Build and validate the FMUs of the components in fmus/, on request with other start values."""
    command = [
        sys.executable,
        str(checkout() / "build_fmus.py"),
        *(names or []),
        *(["--out", str(to)] if to else []),
        *(word for file in parameters or [] for word in ("--parameters", str(file))),
    ]
    raise typer.Exit(subprocess.run(command).returncode)


@command("list")
def list_() -> None:
    """List components, whether they are built, and scenarios with their variants."""
    from gapsense.fmi.package import find_components, load_component

    root = checkout()
    components = [load_component(p) for p in find_components(root / "fmus")]
    built = {p.stem for p in (root / "build" / "fmus").glob("*.fmu")}
    scenarios = [(p.parent, cosim.load(p)) for p in cosim.find_scenarios(root / "scenarios")]
    show(runs.components(components, built), runs.scenarios(root, scenarios))
