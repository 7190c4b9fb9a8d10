"""The key of what was computed: a hash of all that decides results."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.checked import fingerprint
from gapsense._os.files import sha256
from gapsense.shipped import COMPONENTS, INSTALLED, PACKAGE, SCENARIOS

SOURCES = (".py", ".c", ".h", ".csv")


def key(facts: Any) -> str:
    """Hash of all that decides results: facts (of JSON), our sources, the version of numpy."""
    return fingerprint([facts, sources(), np.__version__])


def sources() -> dict[str, str]:
    """Hash of every source file of this package, of the port tables, whose start values studies take, and of studies.

    Taken anew each time, since it may be edited while a program runs. A checkout and what is installed from it agree.
    """
    return {**hashes(PACKAGE, but=INSTALLED), **hashes(COMPONENTS), **hashes(SCENARIOS, (".py",))}


def hashes(folder: Path, endings: Collection[str] = SOURCES, but: Path | None = None) -> dict[str, str]:
    """Hash of every source file below a folder, by its path from there on, `but` those of a folder inside."""
    files = sorted(p for p in folder.rglob("*") if p.suffix in endings and not (but and p.is_relative_to(but)))
    return {path.relative_to(folder.parent).as_posix(): sha256(path) for path in files}
