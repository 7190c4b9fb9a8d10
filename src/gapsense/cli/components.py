"""Commands for components: build them, list them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import FAILED, command, problem, show
from gapsense.fmi.components import find_checkout, find_components, load_component
from gapsense.report import runs

Root = Annotated[
    Path | None, typer.Option(help="Checkout with fmus/", show_default="the working folder, or one above it")
]


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
    root: Root = None,
) -> None:
    """Build and validate the FMUs of the components in fmus/, on request with other start values."""
    from fmpy.validation import validate_fmu

    from gapsense.fmi import package
    from gapsense.studies.identification.transfer import taken

    root = root or find_checkout()
    folders = find_components(root / "fmus", names or ())
    values = taken(folders, parameters, find_components(root / "fmus")) if parameters else {}
    failures = 0
    for folder in folders:
        given = values.get(folder, {})
        path = package.build(folder, to or root / "build" / "fmus", given)
        problems = validate_fmu(str(path))
        word = "INVALID" if problems else "valid"
        more = f", {len(given)} start values given" if parameters else ""
        show(f"{path.name:24} {path.stat().st_size / 1024:6.0f} kB  {word}{more}")
        for sentence in problems:
            problem(f"  {sentence}")
        failures += bool(problems)
    raise typer.Exit(FAILED if failures else 0)


@command("list")
def list_(root: Root = None) -> None:
    """List components, whether they are built, and scenarios with their variants."""
    root = root or find_checkout()
    components = [load_component(p) for p in find_components(root / "fmus")]
    built = {p.stem for p in (root / "build" / "fmus").glob("*.fmu")}
    scenarios = [(p.parent, cosim.load(p)) for p in cosim.find_scenarios(root / "scenarios")]
    show(runs.components(components, built), runs.scenarios(root, scenarios))
