"""What was computed: lines of JSON, one per finished run, that survive being killed at any moment, and their key."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from time import sleep
from typing import IO, Any

import numpy as np

from gapsense._os.checked import Entry, append_lines, damage, fingerprint, read_lines
from gapsense._os.files import naming, sha256
from gapsense._os.locks import lock
from gapsense.shipped import COMPONENTS, INSTALLED, PACKAGE, SCENARIOS

LOG = logging.getLogger(__name__)
PAUSE = 0.1  # seconds between two looks whether a file is free
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


class Ledger:
    """Entries of one sweep in a file that may hold those of others too; a file of None keeps nothing.

    `source` is what they are of, for people and for those who would not mix them with others.
    """

    def __init__(self, file: Path | None, key: str, source: str = "") -> None:
        self.file, self.key = file, key
        self.about = {"key": key, **({"source": source} if source else {})}

    @property
    def folder(self) -> Path | None:
        """Where what belongs to the entries with this key may be kept, and to no others."""
        return None if self.file is None else self.file.with_suffix("") / self.key[:16]

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other process works with this file, and keep others waiting; a kill ends that too."""
        with nullcontext() if self.file is None else alone(self.file):
            yield

    def read(self) -> dict[int, Entry]:
        """Entries with this key by run index; what is damaged is told, and counts as not computed."""
        entries, damaged = self.entries()
        if damaged and self.file:
            LOG.warning("%s. What they held is computed again; delete them.", damage(self.file, damaged))
        return {entry["index"]: entry for entry in entries if entry.get("key") == self.key}

    def entries(self) -> tuple[list[Entry], list[int]]:
        """All entries of the file, also those with other keys, and the lines that are damaged."""
        return ([], []) if self.file is None else read_lines(self.file)

    def append(self, *entries: Entry) -> None:
        """Add entries and see them on the disk."""
        if self.file is not None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            append_lines(self.file, ({**self.about, **entry} for entry in entries))


@contextmanager
def alone(file: Path) -> Iterator[None]:
    """Wait until no other process works with a file, which is made if need be, and keep others waiting."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with naming(file):
        mine = file.open("ab")
    with mine:
        if not is_locked(mine):
            LOG.warning("%s: another process is at work on it; waiting for its end.", file)
            while not is_locked(mine):
                sleep(PAUSE)
        yield


def is_locked(file: IO[bytes]) -> bool:
    """True if the file is locked by us now, or cannot be locked where it is."""
    try:
        return lock(file)
    except OSError:
        return True


def kept(folder: Path, index: int) -> Path:
    """File for the recorded signals of a run."""
    return folder / f"{index:05d}.csv"
