"""Errors of this package, and the sentences they are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gapsense.cosim.record import Result

SHOWN = 12  # names listed in a message before it says how many more there are


class ScenarioError(ValueError):
    """A scenario, or something it names, is wrong; `problems` lists everything found, one sentence each."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(self.problems))


class FmuError(RuntimeError):
    """A component failed while it was loaded or run.

    Attributes
    ----------
    instance : str
        Name of the component in the scenario.
    time : float or None
        Simulated time at the start of the failed step [s]; None before the first step.
    step : int or None
        Base step at whose end the failed step would have ended.
    cause : str
        What failed, and what the component says about it, in one line.
    log : str
        Everything the component logged about the failure, tracebacks included.
    result : Result or None
        What was recorded before the failure.
    """

    def __init__(
        self, instance: str, cause: str, *, time: float | None = None, step: int | None = None, log: str = ""
    ) -> None:
        self.instance, self.time, self.step, self.cause, self.log = instance, time, step, cause, log
        self.result: Result | None = None
        when = "" if time is None else f", t = {time:.9g} s (base step {step})"
        super().__init__(f"{instance}{when}: {cause}")


def suggest(name: str, known: Iterable[str]) -> str:
    """Sentence that offers the nearest known name, or lists what there is."""
    names = sorted(known)
    near = get_close_matches(name, names, n=1)
    if near:
        return f"Did you mean `{near[0]}`?"
    return f"Known: {listing(names)}." if names else "There is none."


def listing(names: Sequence[str]) -> str:
    """Names in back-ticks, shortened where there are many."""
    shown = ", ".join(f"`{name}`" for name in names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"
