"""Commands for components: build them, list them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from gapsense import cosim
from gapsense._os.files import refuse_unwritable
from gapsense.cli.common import Fmus, Output, command
from gapsense.cli.console import FAILED, notice, problem, show
from gapsense.problems import InputError, number_of
from gapsense.shipped import FMU_FOLDER, NATIVE_FOLDER, ROOT


def component_names(incomplete: str) -> list[str]:
    """Completions of a component's name, for the shell."""
    from gapsense.cosim.check import find_fmus

    known = sorted(file.stem for file in find_fmus(Path("here")).glob("*.fmu"))
    return [name for name in known if name.lower().startswith(incomplete.lower())]


Root = Annotated[
    Path | None,
    typer.Option(
        help="Folder with fmus/", show_default="a checkout here or in a parent folder, else what comes with Gapsense"
    ),
]


@command("build")
def build(
    names: Annotated[list[str] | None, typer.Argument(help="Components; all if none is named")] = None,
    to: Annotated[
        Path | None,
        Output.FOLDER,
        typer.Option("--out", help="Where to write them", show_default="build/fmus of the checkout, or here"),
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(help="Parameter-set file of start values; each FMU takes the parameters that it has"),
    ] = None,
    root: Root = None,
    native: Annotated[bool, typer.Option("--native", help="Build native FMUs from C, in build/native")] = False,
    platforms: Annotated[
        list[str] | None,
        typer.Option(
            help="Platforms of native FMUs, separated by commas: linux64, win64, darwin64, aarch64-linux,"
            " wasm32-wasip2, here",
            show_default="all but wasm32-wasip2 with ziglang, else this machine's",
        ),
    ] = None,
    scalars: Annotated[
        bool,
        typer.Option("--scalars", help="Native FMUs without arrays in FMI 3.0, for hosts that do not support them"),
    ] = False,
) -> None:
    """Build and validate the FMUs of the components, with other start values or as native FMUs if asked."""
    from gapsense.fmi.components import components_folder, find_checkout, find_components
    from gapsense.identification.parameter_set import read_sets, take_values

    every = components_folder(root)
    folders = find_components(every, names or ())
    values = take_values(folders, parameters, find_components(every)) if parameters else {}
    if assumed := ", ".join(f"`{name}`" for name in read_sets(parameters or []).assumed):
        notice(f"the parameter file only assumes {assumed}. The FMUs start with these values nevertheless.")
    is_native = bool(native or platforms or scalars)
    to = to or (root or find_checkout() or Path()) / (NATIVE_FOLDER if is_native else FMU_FOLDER)
    refuse_unwritable(folders=[to])  # also where nobody has named it
    made = natives(folders, to, values, platforms, with_arrays=not scalars) if is_native else fmus(folders, to, values)
    failures = 0
    for path, given in made:
        failures += not is_valid(path, f", {number_of(len(given), 'start value')} given" if parameters else "")
    raise SystemExit(FAILED if failures else 0)


Values = Mapping[Path, Mapping[str, Any]]
Built = Iterator[tuple[Path, Mapping[str, Any]]]  # FMUs, and the start values that each was given


def fmus(folders: list[Path], to: Path, values: Values) -> Built:
    """Build the Python FMUs."""
    from gapsense.fmi import package

    for folder in folders:
        given = values.get(folder, {})
        yield package.build(folder, to, given), given


def natives(folders: list[Path], to: Path, values: Values, platforms: list[str] | None, *, with_arrays: bool) -> Built:
    """Build the native FMUs."""
    from gapsense._os.native import NativeError
    from gapsense.fmi.native import package
    from gapsense.fmi.native.platforms import choose_platforms

    names = [name for text in platforms or () for name in text.replace(",", " ").split()]
    try:
        for folder, path in package.build(folders, to, choose_platforms(names), values, with_arrays=with_arrays):
            yield path, values.get(folder, {})
    except NativeError as error:
        raise InputError([str(error)]) from error


def is_valid(path: Path, more: str) -> bool:
    """Validate an FMU, and show what was found."""
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(path))
    show(f"{path.name:24} {path.stat().st_size / 1024:6.0f} kB  {'INVALID' if problems else 'valid'}{more}")
    for sentence in problems:
        problem(f"  {sentence}")
    return not problems


@command("list")
def list_(root: Root = None) -> None:
    """List components, whether they are built, and scenarios with their variants."""
    from gapsense.cosim.check import find_fmus
    from gapsense.fmi.components import find_checkout, find_components, load_component
    from gapsense.report import runs

    base = root or find_checkout() or ROOT
    components = [load_component(p) for p in find_components(base / "fmus")]
    built = {p.stem for p in (base / FMU_FOLDER if root else find_fmus(Path("here"))).glob("*.fmu")}
    show(runs.components(components, built))
    if (base / "scenarios").is_dir():
        list_scenarios("Scenarios", cosim.find_scenarios(base / "scenarios"), base)
    if mine := sorted(Path().glob("*/scenario.toml")):
        list_scenarios("Scenarios in this folder", mine, Path())


@command("info")
def info(
    name: Annotated[
        str,
        typer.Argument(help="Component, as `gapsense list` names it, or any FMU file", autocompletion=component_names),
    ],
    fmus: Fmus = None,
) -> None:
    """Show the ports and parameters of a component or of any FMU, with units, start values and ranges."""
    from gapsense.cosim.check import find_fmus
    from gapsense.cosim.fmu.facts import find_file, read_facts
    from gapsense.report import runs

    facts = read_facts(find_file(name, fmus or find_fmus(Path("here"))))
    show(*runs.facts(facts))
    if facts.problem:
        notice(facts.problem)


def list_scenarios(title: str, files: list[Path], base: Path) -> None:
    """Show scenarios by what you type to run them: those that come with Gapsense by their names."""
    from gapsense.cosim.scenario.read import read_draft
    from gapsense.report import runs

    named = {p.parent.name if base == ROOT else str(p.parent.relative_to(base)): read_draft(p).scenario for p in files}
    show(runs.scenarios(title, named))
