"""Commands for components: build them, list them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import FAILED, command, problem, show
from gapsense.cosim.load import read_draft
from gapsense.cosim.prepare import find_fmus
from gapsense.fmi.components import components_folder, find_checkout, find_components, load_component
from gapsense.report import runs
from gapsense.shipped import FMU_FOLDER, ROOT

Root = Annotated[
    Path | None,
    typer.Option(help="Folder with fmus/", show_default="a checkout here or above, or else what comes with Gapsense"),
]


@command("build")
def build(
    names: Annotated[
        list[str] | None, typer.Argument(help="Components; all if none is named", show_default=False)
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option("--out", help="Where to write them", show_default="build/fmus of the checkout, or here"),
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(help="Parameter-set file of start values; each FMU takes those it has", show_default=False),
    ] = None,
    root: Root = None,
) -> None:
    """Build and validate the FMUs of the components, on request with other start values."""
    from fmpy.validation import validate_fmu

    from gapsense.fmi import package
    from gapsense.studies.identification.transfer import taken

    every = components_folder(root)
    folders = find_components(every, names or ())
    values = taken(folders, parameters, find_components(every)) if parameters else {}
    to = to or (root or find_checkout() or Path()) / FMU_FOLDER
    failures = 0
    for folder in folders:
        given = values.get(folder, {})
        path = package.build(folder, to, given)
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
    base = root or find_checkout() or ROOT
    components = [load_component(p) for p in find_components(base / "fmus")]
    built = {p.stem for p in (base / FMU_FOLDER if root else find_fmus(Path("here"))).glob("*.fmu")}
    show(runs.components(components, built))
    if (base / "scenarios").is_dir():
        listed("Scenarios", cosim.find_scenarios(base / "scenarios"), base)
    if mine := sorted(Path().glob("*/scenario.toml")):
        listed("Scenarios in this folder", mine, Path())


def listed(title: str, files: list[Path], base: Path) -> None:
    """Show scenarios by what one types to run them: those that come with Gapsense by their names."""
    named = {p.parent.name if base == ROOT else str(p.parent.relative_to(base)): read_draft(p).scenario for p in files}
    show(runs.scenarios(title, named))
