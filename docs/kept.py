"""What of the site takes long is kept in `build`, and made anew where it is older than the sources."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("src", "fmus", "scenarios", "docs/examples")
ENDINGS = (".py", ".toml", ".csv", ".c", ".js", ".css", ".html")


def kept(name: str, make: Callable[[Path], object]) -> Path:
    """A file of `build`, complete whoever else makes it now."""
    file = ROOT / "build" / name
    if not file.is_file() or file.stat().st_mtime < newest():
        part = file.with_name(f"{os.getpid()}_{file.name}")
        part.parent.mkdir(parents=True, exist_ok=True)
        make(part)
        part.replace(file)
        file.touch()
    return file


@cache
def newest() -> float:
    """Time of the newest source."""
    files = (p for folder in FOLDERS for p in (ROOT / folder).rglob("*") if p.suffix in ENDINGS)
    return max(p.stat().st_mtime for p in files if "results" not in p.parts)
