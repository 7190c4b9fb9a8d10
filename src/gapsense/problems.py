"""Errors of this package, and the sentences they are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

SHOWN = 12  # names listed in a message before it says how many more there are


class InputError(ValueError):
    """What a user gave is wrong; `problems` lists everything found, one sentence each."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(self.problems))


class ScenarioError(InputError):
    """A scenario, or something it names, is wrong."""


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
