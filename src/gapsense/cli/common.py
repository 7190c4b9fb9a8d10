"""What all commands share: the app, the consoles, errors that a user can mend, progress.

Exit codes: 0 all well; 1 a test, a metric or a validation failed; 2 wrong input; 3 a component failed during a run;
130 interrupted (what was computed is kept).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gapsense import cosim

FAILED, WRONG_INPUT, COMPONENT_FAILED, INTERRUPTED = 1, 2, 3, 130

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""FMI co-simulation components for short-stroke reluctance actuators.

Start with `gapsense build`, `gapsense list` and `gapsense run scenarios/semera_valve`.

Exit codes: 0 all well, 1 a test or a metric failed, 2 wrong input, 3 a component failed, 130 interrupted.""",
)
study = typer.Typer(no_args_is_help=True, help="Studies of the papers: figures, numbers beside the published.")
app.add_typer(study, name="study")
WIDTH = None if sys.stdout.isatty() else 110  # of tables in files and logs
out = Console(highlight=False, soft_wrap=True, width=WIDTH)
err = Console(stderr=True, highlight=False, soft_wrap=True)

Scenario = Annotated[Path, typer.Argument(help="Folder of a scenario, or its scenario.toml", show_default=False)]
Variant = Annotated[str | None, typer.Option(help="Variant of the scenario", show_default=False)]
Fmus = Annotated[Path | None, typer.Option(help="Folder of the FMUs", show_default="build/fmus")]


@contextmanager
def reported() -> Iterator[None]:
    """Turn the errors a user can mend into one sentence and an exit code."""
    try:
        yield
    except cosim.ScenarioError as error:
        for problem in error.problems:
            err.print(problem, style="red", markup=False)
        raise typer.Exit(WRONG_INPUT) from None
    except typer.Exit:  # a RuntimeError too
        raise
    except RuntimeError as error:  # FmuError, or a worker process of a sweep that died
        err.print(str(error), style="red", markup=False)
        raise typer.Exit(COMPONENT_FAILED) from None
    except (OSError, ValueError) as error:
        err.print(sentence(error), style="red", markup=False)
        raise typer.Exit(WRONG_INPUT) from None
    except KeyboardInterrupt:
        err.print("interrupted.", style="yellow")
        raise typer.Exit(INTERRUPTED) from None


def sentence(error: OSError | ValueError) -> str:
    """What went wrong; the operating system's errors with the path first."""
    if isinstance(error, OSError) and error.filename:
        return f"`{error.filename}`: {error.strerror}. Correct the path, or make room for it."
    return str(error)


def stop_if_interrupted(result: cosim.Result) -> None:
    """Leave after a Ctrl-C, where half a run is of no use."""
    if result.interrupted:
        err.print(f"interrupted at t = {result.times[-1]:.6g} s; nothing was written.", style="yellow")
        raise typer.Exit(INTERRUPTED)


@contextmanager
def bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on a terminal; calls with done and total elsewhere do nothing."""
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def checkout() -> Path:
    """The checkout that holds fmus/ and build_fmus.py: the working folder or one above it."""
    here = Path.cwd()
    found = next((p for p in (here, *here.parents) if (p / "build_fmus.py").is_file() and (p / "fmus").is_dir()), None)
    if found is None:
        raise FileNotFoundError(
            f"{here}: neither here nor above is a checkout of Gapsense (fmus/, build_fmus.py). Change there."
        )
    return found


def keep(error: cosim.FmuError, folder: Path) -> None:
    """Save what was recorded before a component failed, and say where."""
    if error.result is not None and error.result.times.size:
        file = error.result.save(folder / f"{stem(error.result)}.csv")
        err.print(f"{file}: {error.result.times.size} rows from before the failure.", style="yellow", markup=False)


def stem(result: cosim.Result) -> str:
    """File name of a result, without its ending."""
    return result.run.scenario.replace("[", "_").rstrip("]")
