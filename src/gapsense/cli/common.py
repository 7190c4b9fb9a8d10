"""What all commands share: the app, the consoles, errors that a user can fix, progress.

Exit codes: 0 all well; 1 a test, a metric or a validation failed; 2 wrong input; 3 a component failed during a run;
130 interrupted (what was computed is kept).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar, cast

import typer
from typer.core import TyperCommand

from gapsense import cosim
from gapsense._os import interrupts
from gapsense._os.files import refuse_unwritable
from gapsense.cli.console import FAILED, notice, problem, report_errors, say_written, show
from gapsense.problems import InputError, listing
from gapsense.shipped import examples
from gapsense.version import __version__

if TYPE_CHECKING:
    from gapsense.functions import Found


class App(typer.Typer):
    """The program. A Ctrl-C before a command has begun ends it with one word."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Run the command that the arguments name."""
        with interrupts.ended_like_ctrl_c(), interrupts.handle(interrupts.leave):
            return super().__call__(*arguments, **options)


app = App(
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""FMI co-simulation components for short-stroke reluctance actuators.

Start with `gapsense list`, `gapsense run semera_valve` and `gapsense new my_valve`.

Exit codes: 0 all well, 1 a test or a metric failed or a record is not explained, 2 wrong input, 3 a component failed,
130 interrupted.""",
)


def show_version(asked: bool) -> None:
    """Print the version, on request, and end."""
    if asked:
        typer.echo(f"gapsense {__version__}")
        raise SystemExit


@app.callback()
def options(
    _: Annotated[
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="Print the version")
    ] = False,
) -> None:
    """Options of the program itself."""


studies = typer.Typer(
    no_args_is_help=True, help="Repeat studies of the papers: figures, and numbers beside the published ones."
)
app.add_typer(studies, name="study")


def scenario_names(incomplete: str) -> list[str]:
    """Completions of a scenario's name, for the shell: folders, scenario files, names of examples."""
    folder = Path(incomplete).parent if not incomplete.endswith("/") else Path(incomplete)
    inside = [str(file) for file in folder.glob("*.toml")] if incomplete.endswith("/") else []
    known = {*(str(file.parent) for file in folder.glob("*/scenario.toml")), *inside, *examples()}
    return sorted(name for name in known if name.startswith(incomplete))


Scenario = Annotated[
    Path,
    typer.Argument(
        help="Folder of a scenario, its scenario.toml, or the name of an example",
        show_default=False,
        autocompletion=scenario_names,
    ),
]
Variant = Annotated[str | None, typer.Option(help="Variant of the scenario")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", help="COMPONENT.PARAMETER=VALUE: replace a value; inputs and seeds work too"),
]
Fmus = Annotated[
    Path | None,
    typer.Option(help="Folder with the FMUs", show_default="build/fmus, or else those that come with Gapsense"),
]
ENGINE = "How to run: fmu, native, vectors (Gapsense's own components without FMUs, bit-identical), or auto"
Engine = Annotated[
    str,
    typer.Option(help=ENGINE, show_default="auto: vectors if there is a C compiler and all FMUs are Gapsense's own"),
]
EngineOfTests = Annotated[str, typer.Option("--engine", help=ENGINE)]
Native = Annotated[bool, typer.Option("--native", help="Use the native FMUs in build/native")]


def folder(path: Path) -> Path:
    """A folder to write to; the name of a file is refused."""
    from gapsense.cosim.result.sidecar import ENDINGS

    if path.suffix.lower() in (".csv", *ENDINGS) and not path.is_dir():
        raise typer.BadParameter(f"`{path}` found, a folder expected. Correct it.")
    return path


class Output(Enum):
    """What a command writes to a path: it stands beside an option, and is checked before the command begins."""

    FILE = "file"
    FOLDER = "folder"


Out = Annotated[Path, Output.FOLDER, typer.Option("--out", help="Folder for figures and numbers", callback=folder)]
FigureFile = Annotated[Path, Output.FILE, typer.Option("--out", help="PNG, PDF or SVG file")]
Picture = Annotated[Path | None, Output.FILE, typer.Option("--figure", help="PNG, PDF or SVG file")]
Workers = Annotated[int, typer.Option(help="Number of processes; results do not depend on it", min=1, max=1000)]
Function = TypeVar("Function", bound=Callable[..., None])


class Command(TyperCommand):
    """A command that refuses an option given twice, of which a parser takes the last."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of the command line."""
        _, _, given = self.make_parser(ctx).parse_args(args=[*args])
        once = [one for one in given if not (one.multiple or getattr(one, "is_flag", False))]
        twice = {one.opts[0] for one in once if one.param_type_name == "option" and once.count(one) > 1}
        if twice and not ctx.resilient_parsing:
            ctx.fail(f"{listing(sorted(twice))}: given twice. Keep one.")
        return super().parse_args(ctx, args)


def command(name: str, group: typer.Typer = app) -> Callable[[Function], Function]:
    """Register a function as a command. Errors that the user can fix end it with their sentences and an exit code."""
    return lambda function: group.command(name, cls=Command)(report_errors()(check_outputs(function)))


def check_outputs(function: Function) -> Function:
    """Let a command refuse, before it begins, outputs that cannot be written."""

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> None:
        known = signature(function, eval_str=True)
        given = known.bind(*arguments, **options).arguments
        notes = {name: getattr(known.parameters[name].annotation, "__metadata__", ()) for name in given}
        files, folders = ([given[n] for n in given if given[n] and kind in notes[n]] for kind in Output)
        refuse_unwritable(*files, folders=folders)
        function(*arguments, **options)

    return cast(Function, call)


def study(name: str) -> Callable[[Function], Function]:
    """Register a function as a command `gapsense study NAME`."""
    return command(name, studies)


def engine_of(engine: str, native: bool) -> str:
    """The engine that two options choose together."""
    if native and engine == "vectors":
        raise InputError([f"--native and --engine {engine} cannot be combined. Leave one out."])
    return "native" if native else engine


def as_vectors(result: Any) -> str:
    """How a sweep or a campaign was computed, if not by FMUs."""
    return ", as vectors" if result.computed and result.engine == "vectors" else ""


def open_in_browser(file: Path) -> None:
    """Show a file in the browser, or say that no browser was found; the file is written in any case."""
    import webbrowser

    if not webbrowser.open(file.resolve().as_uri()):
        notice(f"no browser was found. Open {file} yourself.")


def tell(found: Found) -> NoReturn:
    """Print what a function found, and end the command."""
    for text in found.notes:
        problem(text, "yellow")
    show(*found.shown)
    pictures = [file for file in found.files if file.suffix in (".png", ".pdf", ".svg")]
    for files in ([file for file in found.files if file not in pictures], pictures):
        if files:
            say_written(*files)
    for text in found.doubts:
        problem(text)
    raise SystemExit(0 if found.passed else FAILED)


def stem(result: cosim.Result) -> str:
    """File name of a result, without its ending."""
    return result.run.scenario.replace("[", "_").rstrip("]")
