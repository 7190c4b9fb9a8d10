"""The loop over base steps of a run: in C where its library loads, in Python anywhere else, with the same bits."""

from __future__ import annotations

from gapsense.cosim.run.loop.compiled import entry, in_c
from gapsense.cosim.run.loop.reference import in_python
from gapsense.cosim.run.loop.work import Advance, Work

__all__ = ["Advance", "Work", "advancer", "language"]


def language() -> str:
    """What the loop is written in, as a result tells it."""
    return "C" if entry() else "Python"


def advancer(work: Work) -> Advance:
    """Function that does base steps up to a given one, and says how far it came."""
    run = entry()
    return in_c(work, run) if run else in_python(work)
