"""Errors of this package, and the sentences they are made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parent
FOUNDATIONS = (PACKAGE, *(PACKAGE / name for name in ("_os", "kernels", "kernels/emit", "fmi")))
SHOWN = 12  # names listed in a message before it says how many more there are


class InputError(ValueError):
    """What a user gave is wrong; `problems` lists everything found, one sentence each."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = list(dict.fromkeys(problems))
        super().__init__("\n".join(self.problems))


class ScenarioError(InputError):
    """A scenario, or something it names, is wrong."""


class FmuError(RuntimeError):
    """A component failed while it was loaded or run.

    `time` [s] is the start of the failed step (None before the first), which would have ended at base step `step`.
    `cause` is one line, `log` all that the component said; `result` has what was recorded before.
    """

    def __init__(
        self, instance: str, cause: str, *, time: float | None = None, step: int | None = None, log: str = ""
    ) -> None:
        self.instance, self.time, self.step, self.cause, self.log = instance, time, step, cause, log
        self.result: Any = None  # a `Result`
        when = "" if time is None else f", t = {time:.9g} s (base step {step})"
        super().__init__(f"{instance}{when}: {cause}")

    def adding(self, sentence: str) -> FmuError:
        """The same with one more sentence in its cause."""
        return FmuError(self.instance, f"{self.cause} {sentence}", time=self.time, step=self.step, log=self.log)


class CodeError(ValueError):
    """The code of a component cannot be used; the message is one sentence with file and line."""


@contextmanager
def code(file: str | Path) -> Iterator[None]:
    """Errors of what a component's author wrote in `file`, or in what it imports, become a CodeError."""
    try:
        yield
    except CodeError:  # an error of another component, whose table this one uses
        raise
    except Exception as error:
        place, text = place_of(error) or str(file), " ".join(str(error).split())
        if isinstance(error, SyntaxError):
            text = error.msg
        if not isinstance(error, (TypeError, ValueError)) or not text.endswith("."):  # others than those of ours
            text = f"{type(error).__name__}: {text.rstrip('?.')}. Correct it."
        raise CodeError(text if text.startswith(place.partition(":")[0]) else f"{place}: {text}") from error


def place_of(error: Exception) -> str:
    """File and line that an error points at: the last that belong neither to our foundations nor to a library."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}"
    from sysconfig import get_path  # here, so that programs start fast
    from traceback import extract_tb

    libraries = tuple(map(get_path, ("stdlib", "purelib", "platlib")))
    for frame in reversed(extract_tb(error.__traceback__)):
        file = Path(frame.filename)
        is_others = not file.is_relative_to(PACKAGE) and frame.filename.startswith(("<", *libraries))
        if file.parent not in FOUNDATIONS and not is_others:
            return f"{file}:{frame.lineno}"
    return ""


def number_of(count: int, noun: str) -> str:
    """A count with its noun, in the plural where that is right: `1 row`, `2 rows`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def format_limits(low: float | str | None, high: float | str | None, form: str = "g") -> str:
    """Write limits in words, each with a format, of texts the empty one; nothing without any."""
    if low is None:
        return "" if high is None else f"at most {high:{form}}"
    return f"at least {low:{form}}" if high is None else f"{low:{form}} to {high:{form}}"


def suggest(name: str, known: Iterable[str]) -> str:
    """Sentence that offers the nearest known name, or lists what there is."""
    from difflib import get_close_matches  # here, so that programs start fast

    names = sorted(known)
    near = get_close_matches(name, names, n=1)
    if near:
        return f"Did you mean `{near[0]}`?"
    return f"Known: {listing(names)}." if names else "There is none."


def listing(names: Sequence[str]) -> str:
    """Names in back-ticks, shortened where there are many."""
    shown = ", ".join(f"`{name}`" for name in names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"


def require_package(package: str) -> None:
    """Raise an InputError if a package of the extra is not installed."""
    try:
        import_module(package)
    except ModuleNotFoundError:
        problem = f"{package} is needed but not installed: `pip install 'gapsense[campaign]'`."
        raise InputError([problem]) from None
