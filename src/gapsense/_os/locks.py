"""Locks on files, and folders, that are released and removed when the process that holds them ends, however it ends."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PREFIX, HELD = "gapsense-", ".held"  # of temporary folders, and the locked file in each of them
CACHE = "GAPSENSE_CACHE"  # names another folder for what is worth keeping
FACTS = "fmu-"  # how files there begin that tell what an FMU says of itself
FAR = 2**30  # the byte that is locked on Windows, beyond all that is written
_folders: dict[Path, IO[bytes]] = {}


def lock(file: IO[bytes]) -> bool:
    """True if the file was not locked and is now, until it is closed; an OSError where there are no locks."""
    try:
        if sys.platform == "win32":
            file.seek(FAR)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True


def held(make: Callable[[], Path]) -> IO[bytes]:
    """A new file, open and locked; it is made again if another process takes it for abandoned before the lock."""
    while True:
        with suppress(FileNotFoundError):
            path = make()
            file = path.open("r+b")
            with suppress(OSError):  # where there are no locks, nobody takes it either
                lock(file)
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
            file.close()


def remove_abandoned(path: Path, remove: Callable[[Path], None]) -> None:
    """Remove a file that was locked by a process which is no more; what belongs to others is left alone."""
    with suppress(OSError), path.open("r+b") as file:
        if lock(file):
            remove(path)


def temporary_folder(base: Path | None = None) -> Path:
    """A new folder, held by this process, in `base` or the usual place; those of processes that died are removed."""
    place = base or Path(tempfile.gettempdir())
    for folder in place.glob(f"{PREFIX}*"):
        remove_abandoned(folder / HELD, lambda file: shutil.rmtree(file.parent, ignore_errors=True))
        with suppress(OSError):
            folder.rmdir()  # if it is empty: of a process that died before the lock

    def make() -> Path:
        file = Path(tempfile.mkdtemp(prefix=PREFIX, dir=place), HELD)
        file.touch()
        return file

    for folder in [folder for folder in _folders if not folder.exists()]:
        _folders.pop(folder).close()
    file = held(make)
    folder = Path(file.name).parent
    _folders[folder] = file
    return folder


def cache_folder() -> Path:
    """Folder for what is worth keeping between processes."""
    if named := os.environ.get(CACHE):
        return Path(named)
    home = Path("~").expanduser()
    usual = {"win32": home / "AppData" / "Local", "darwin": home / "Library" / "Caches"}.get(sys.platform)
    return Path(os.environ.get("XDG_CACHE_HOME") or usual or home / ".cache") / "gapsense"
