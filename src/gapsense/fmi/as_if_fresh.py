"""Build an FMU in a process that may have loaded FMUs, or may load this one later."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import distribution
from pathlib import Path
from types import ModuleType


@contextmanager
def as_if_fresh(folder: Path, *names: str) -> Iterator[None]:
    """Imports from a folder and of the installed pythonfmu; afterwards it is as if nothing had been imported.

    A loaded FMU has put its own copy of pythonfmu, without what building needs, before the installed one.
    """
    names = (*names, "pythonfmu")
    path, before = sys.path[:], drop(names)
    sys.path[:0] = [str(folder), str(distribution("pythonfmu").locate_file(""))]
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:] = path
        drop(names)
        sys.modules.update(before)


def drop(names: tuple[str, ...]) -> dict[str, ModuleType]:
    """Forget the modules of some packages, and give them."""
    return {name: sys.modules.pop(name) for name in list(sys.modules) if name.partition(".")[0] in names}
