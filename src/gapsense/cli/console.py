"""What commands need while they run: the consoles, errors that a user can fix, progress. It loads no typer.

Exit codes: 0 all well; 1 a test, a metric or a validation failed; 2 wrong input; 3 a component failed during a run;
130 interrupted (what was computed is kept).
"""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gapsense import cosim
from gapsense._os import interrupts
from gapsense.problems import InputError
from gapsense.shipped import NATIVE_FOLDER

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

ELSEWHERE = "or choose another folder"
ADVICE = {
    errno.ENOSPC: f"Make room on its disk, {ELSEWHERE}",
    errno.EDQUOT: f"Make room within your share of its disk, {ELSEWHERE}",
    errno.EFBIG: f"Allow larger files (`ulimit -f`), {ELSEWHERE}",
    errno.EMFILE: "Allow more open files (`ulimit -n`), or use fewer workers",
    errno.ENFILE: "Close other programs, or use fewer workers",
}
FAILED, WRONG_INPUT, COMPONENT_FAILED, INTERRUPTED = 1, 2, 3, interrupts.INTERRUPTED


@cache
def consoles() -> tuple[Console, Console]:
    """Those of the output and of the error stream; `:x:` is no picture on them."""
    from rich.console import Console  # here: it is loaded while another process works

    return Console(highlight=False, emoji=False), Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)


def show(*items: Table | str) -> None:
    """Print tables and sentences."""
    from gapsense.report import table

    table.show(consoles()[0], *items)


def problem(sentence: str, style: str = "red") -> None:
    """Print a sentence on the error stream."""
    consoles()[1].print(sentence, style=style, markup=False)


def notice(sentence: str) -> None:
    """Print a sentence that is no error on the error stream."""
    problem(sentence, "yellow")


APART: dict[str, Any] = {"isolation": "process", "notice": notice}  # how commands run scenarios


def choose_fmus(scenario: Path, fmus: Path | None, native: bool) -> Path | None:
    """Choose the folder of the FMUs from options, if they name one."""
    if not native:
        return fmus
    folder = cosim.find_fmus(cosim.scenario_file(scenario), NATIVE_FOLDER)
    if fmus:
        raise InputError(["--native and --fmus both say which FMUs to take. Leave one out."])
    if not folder.is_dir():
        raise InputError([f"there is no folder `{folder}`. Make it with `gapsense build --native`."])
    return folder


def say_written(*files: Path) -> None:
    """Say which files were written."""
    show(f"{', '.join(map(str, files))} written.")


@contextmanager
def report_errors() -> Iterator[None]:
    """Turn the errors that a user can fix into one sentence and an exit code."""
    try:
        with interrupts.handle(signal.default_int_handler):
            yield
    except SystemExit:  # before `mendable`, which takes a while
        raise
    except KeyboardInterrupt:  # likewise: numpy cannot be loaded again after half a load
        problem("interrupted.", "yellow")
        raise SystemExit(INTERRUPTED) from None
    except RuntimeError as error:  # FmuError, or a worker process of a sweep that died
        problem(str(error))
        raise SystemExit(COMPONENT_FAILED) from None
    except mendable() as error:
        sentences = getattr(error, "problems", [str(error)])
        if isinstance(error, OSError) and (error.filename or error.errno in ADVICE):
            place = f"`{error.filename}`: " if error.filename else ""
            found = os.strerror(error.errno) if error.errno in ADVICE else error.strerror  # others add to it
            advice = ADVICE.get(error.errno or 0, f"Correct the path, {ELSEWHERE}")
            sentences = [f"{place}{found}. {advice}."]
        for sentence in sentences:
            problem(sentence)
        raise SystemExit(WRONG_INPUT) from None


def mendable() -> tuple[type[Exception], ...]:
    """Types of errors that come from what a user gave."""
    from gapsense.kernels.trace import TraceError  # here, so that what needs no arrays starts fast

    return OSError, ValueError, TraceError


def stop_if_interrupted(result: cosim.Result) -> None:
    """Leave after Ctrl-C, where half a run is useless."""
    if result.interrupted:
        problem(f"interrupted at t = {result.times[-1]:.6g} s; nothing was written.", "yellow")
        raise SystemExit(INTERRUPTED)


@contextmanager
def bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on a terminal, from the first call with `done` and `total`; elsewhere the calls do nothing.

    The first call also loads what shows tables, while other processes do the work.
    """
    with ExitStack() as stack:

        @cache
        def update() -> Callable[..., None]:
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            progress = stack.enter_context(Progress(*columns, console=consoles()[1], transient=True))
            return partial(progress.update, progress.add_task(title, total=None))

        def tell(done: int, total: int) -> None:
            import gapsense.report.runs  # noqa: F401

            if consoles()[1].is_terminal:
                update()(completed=done, total=total)

        yield tell
