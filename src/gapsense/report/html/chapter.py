"""What a chapter of the page says first, and how its bounds are written."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from gapsense.report.html.figures import Drawn


class Verdict(NamedTuple):
    """Outcome of a run in a few words, and whether it is good."""

    passed: bool
    sentences: tuple[str, ...]
    words: tuple[str, str] = ("passed", "failed")

    @property
    def word(self) -> str:
        """The verdict as one word."""
        return self.words[not self.passed]


class Chapter(NamedTuple):
    """A result on the page: a template, what it asks for, and the figures that are in it."""

    key: str
    title: str
    name: str
    about: str
    verdict: Verdict
    template: str
    content: Mapping[str, Any]
    figures: tuple[Drawn, ...]


def limits(bounds: tuple[float, float] | None, shown: Callable[[float], str]) -> str:
    """Bounds in words, each as `shown` writes it."""
    low, high = bounds or (-math.inf, math.inf)
    if math.isfinite(low) and math.isfinite(high):
        return f"{shown(low)} to {shown(high)}"
    ends = (("at least", low), ("at most", high))
    return " ".join(f"{word} {shown(end)}" for word, end in ends if math.isfinite(end))
