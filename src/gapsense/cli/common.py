"""What all commands share: the app, the consoles, errors that a user can fix, progress.

Exit codes: 0 all well; 1 a test, a metric or a validation failed; 2 wrong input; 3 a component failed during a run;
130 interrupted (what was computed is kept).
"""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar, cast

import typer
from rich.console import Console
from rich.table import Table

from gapsense import cosim
from gapsense._os import interrupts
from gapsense._os.plain_files import refuse_unwritable
from gapsense.problems import InputError
from gapsense.report import table
from gapsense.shipped import NATIVE_FOLDER, examples, record
from gapsense.version import __version__

if TYPE_CHECKING:
    from gapsense.functions import Found

ELSEWHERE = "or choose another folder"
ADVICE = {
    errno.ENOSPC: f"Make room on its disk, {ELSEWHERE}",
    errno.EDQUOT: f"Make room within your share of its disk, {ELSEWHERE}",
    errno.EFBIG: f"Allow larger files (`ulimit -f`), {ELSEWHERE}",
    errno.EMFILE: "Allow more open files (`ulimit -n`), or use fewer workers",
    errno.ENFILE: "Close other programs, or use fewer workers",
}
FAILED, WRONG_INPUT, COMPONENT_FAILED, INTERRUPTED = 1, 2, 3, 130


class App(typer.Typer):
    """The program. Ctrl-C before a command has begun ends it with one word."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Run the command that the arguments name."""
        with interrupts.ended_like_ctrl_c(), interrupts.handled(interrupts.leave):
            return super().__call__(*arguments, **options)


app = App(
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""FMI co-simulation components for short-stroke reluctance actuators.

Start with `gapsense list`, `gapsense run semera_valve` and `gapsense new my_valve`.

Exit codes: 0 all well, 1 a test or a metric failed, 2 wrong input, 3 a component failed, 130 interrupted.""",
)


def show_version(asked: bool) -> None:
    """Print the version, on request, and end."""
    if asked:
        typer.echo(f"gapsense {__version__}")
        raise typer.Exit


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
out = Console(highlight=False, emoji=False)  # `:x:` is no picture
err = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)


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
Variant = Annotated[str | None, typer.Option(help="Variant of the scenario", show_default=False)]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", help="COMPONENT.PARAMETER=VALUE: replace a value; inputs and seeds work too", show_default=False
    ),
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
SetFile = Annotated[Path, Output.FILE, typer.Option("--out", help="Parameter-set file to write")]
Picture = Annotated[Path | None, Output.FILE, typer.Option("--figure", help="PNG, PDF or SVG file", show_default=False)]
Workers = Annotated[int, typer.Option(help="Number of processes; results do not depend on it", min=1, max=1000)]
Data = Annotated[
    list[Path],
    typer.Argument(
        parser=record,
        metavar="FILE",
        help="CSV files: time [s], voltage [V], current [A]; `sample_valve.csv` comes with Gapsense",
        show_default=False,
    ),
]
Validate = Annotated[
    list[Path] | None,
    typer.Option(
        parser=record, metavar="FILE", help="Record to validate with; it is not used for the fit", show_default=False
    ),
]
Column = Annotated[
    list[str] | None,
    typer.Option(help="QUANTITY=NAME: column, or signal of a result, that holds the quantity", show_default=False),
]
Separator = Annotated[str, typer.Option(help="Separator of the columns of a CSV file")]
Decimal = Annotated[str, typer.Option(help="Decimal mark of the numbers")]
Clipped = Annotated[bool, typer.Option("--clipped", help="Accept signals that reach the limits of their converter")]
Assume = Annotated[
    bool,
    typer.Option(
        "--assume", help="Assume missing values, list them and mark them in the file; results are then relative"
    ),
]
Function = TypeVar("Function", bound=Callable[..., None])


def command(name: str, group: typer.Typer = app) -> Callable[[Function], Function]:
    """Register a function as a command; errors that the user can fix end it with one sentence and an exit code."""
    return lambda function: group.command(name)(reported()(checked(function)))


def checked(function: Function) -> Function:
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


def show(*items: Table | str) -> None:
    """Print tables and sentences."""
    table.show(out, *items)


def problem(sentence: str, style: str = "red") -> None:
    """Print a sentence on the error stream."""
    err.print(sentence, style=style, markup=False)


def notice(sentence: str) -> None:
    """Print a sentence that is no error on the error stream."""
    problem(sentence, "yellow")


APART: dict[str, Any] = {"isolation": "process", "notice": notice}  # how commands run scenarios


def engine_of(engine: str, native: bool) -> str:
    """The engine that two options choose together."""
    if native and engine == "vectors":
        raise InputError([f"--native and --engine {engine} cannot be combined. Leave one out."])
    return "native" if native else engine


def as_vectors(result: Any) -> str:
    """How a sweep or a campaign was computed, if not by FMUs."""
    return ", as vectors" if result.computed and result.engine == "vectors" else ""


def chosen(scenario: Path, fmus: Path | None, native: bool) -> Path | None:
    """Folder of the FMUs that options choose, if they do."""
    if not native:
        return fmus
    from gapsense.cosim.prepare import find_fmus
    from gapsense.cosim.scenario.document import scenario_file

    folder = find_fmus(scenario_file(scenario), NATIVE_FOLDER)
    if fmus:
        raise InputError(["--native and --fmus both say which FMUs to take. Leave one out."])
    if not folder.is_dir():
        raise InputError([f"there is no folder `{folder}`. Make it with `gapsense build --native`."])
    return folder


def written(*files: Path) -> None:
    """Say which files were written."""
    show(f"{', '.join(map(str, files))} written.")


def shown(file: Path) -> None:
    """Show a file in the browser, or say that there is none: it is written all the same."""
    import webbrowser

    if not webbrowser.open(file.resolve().as_uri()):
        notice(f"no browser was found. Open {file} yourself.")


def tell(found: Found) -> NoReturn:
    """Print what a function has found, and end the command."""
    for text in found.notes:
        problem(text, "yellow")
    show(*found.shown)
    pictures = [file for file in found.files if file.suffix in (".png", ".pdf", ".svg")]
    for files in ([file for file in found.files if file not in pictures], pictures):
        if files:
            written(*files)
    for text in found.doubts:
        problem(text)
    raise typer.Exit(0 if found.passed else FAILED)


@contextmanager
def reported() -> Iterator[None]:
    """Turn the errors that a user can fix into one sentence and an exit code."""
    try:
        with interrupts.handled(signal.default_int_handler):
            yield
    except typer.Exit:  # a RuntimeError too
        raise
    except KeyboardInterrupt:  # before `mendable`, which imports: numpy cannot be loaded again after half a load
        problem("interrupted.", "yellow")
        raise typer.Exit(INTERRUPTED) from None
    except RuntimeError as error:  # FmuError, or a worker process of a sweep that died
        problem(str(error))
        raise typer.Exit(COMPONENT_FAILED) from None
    except mendable() as error:
        sentences = getattr(error, "problems", [str(error)])
        if isinstance(error, OSError) and (error.filename or error.errno in ADVICE):
            place = f"`{error.filename}`: " if error.filename else ""
            found = os.strerror(error.errno) if error.errno in ADVICE else error.strerror  # others add to it
            advice = ADVICE.get(error.errno or 0, f"Correct the path, {ELSEWHERE}")
            sentences = [f"{place}{found}. {advice}."]
        for sentence in sentences:
            problem(sentence)
        raise typer.Exit(WRONG_INPUT) from None


def mendable() -> tuple[type[Exception], ...]:
    """Types of errors that come from what a user gave."""
    from gapsense.kernels.trace import TraceError  # here, so that what needs no arrays starts fast

    return OSError, ValueError, TraceError


def stop_if_interrupted(result: cosim.Result) -> None:
    """Leave after Ctrl-C, where half a run is useless."""
    if result.interrupted:
        problem(f"interrupted at t = {result.times[-1]:.6g} s; nothing was written.", "yellow")
        raise typer.Exit(INTERRUPTED)


@contextmanager
def bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on a terminal; calls with done and total elsewhere do nothing."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def stem(result: cosim.Result) -> str:
    """File name of a result, without its ending."""
    return result.run.scenario.replace("[", "_").rstrip("]")
