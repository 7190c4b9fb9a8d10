"""FMUs unpacked once per process and content: the same library is then never loaded from two places.

Libraries of Python FMUs stay in memory for ever, so what is unpacked anew for each run costs memory for each run.
"""

from __future__ import annotations

import atexit
import os
import re
import shutil
import tempfile
import zipfile
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import IO

from gapsense.cosim.descriptions import Description
from gapsense.cosim.record import FmuError
from gapsense.files import sha256

try:
    import fcntl
except ImportError:  # Windows, where files in use cannot be removed anyway
    fcntl = None  # type: ignore[assignment]

PLAIN = re.compile(r"[A-Za-z0-9_./:\\~-]+")
PREFIX, LOCK = "gapsense-", "lock"


def unpacked(description: Description) -> Path:
    """Folder with the content of an FMU, until the process ends."""
    folder = home(os.getpid()) / description.sha256
    if not folder.is_dir():
        if sha256(description.path) != description.sha256:
            raise FmuError(description.name, f"`{description.path}` has changed since it was read. Start again.")
        part = Path(tempfile.mkdtemp(dir=folder.parent))
        try:
            with zipfile.ZipFile(description.path) as archive:
                archive.extractall(part)
        except (OSError, zipfile.BadZipFile) as error:
            shutil.rmtree(part, ignore_errors=True)
            why = f"`{description.path}` cannot be unpacked into `{folder.parent}`: {error}"
            raise FmuError(description.name, f"{why}. Look at the file and at the space on that disk.") from error
        with suppress(OSError):  # another thread was faster
            part.rename(folder)
    return folder


@cache
def home(process: int) -> Path:
    """Folder for what this process unpacks; it is removed with it, or else by the next one."""
    folder = temporary_folder()
    remove_orphans(folder.parent)
    lock = locked(folder)
    atexit.register(remove, folder, process, lock)
    return folder


def temporary_folder() -> Path:
    """A new folder with a plain ASCII path: FMUs may fail on any other, see section 1 of hosts.md."""
    for base in (None, "/tmp", "."):
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=base)).resolve()
        if PLAIN.fullmatch(str(folder)):
            return folder
        folder.rmdir()
    raise FmuError("fmus", "no temporary folder has a plain ASCII path. Set TMPDIR to one that has.")


def locked(folder: Path) -> IO[str] | None:
    """A file that is locked as long as this process lives; it has its name only then, or others would take the lock."""
    if fcntl is None:
        return None
    file = (folder / f"{LOCK}.new").open("w")
    fcntl.flock(file, fcntl.LOCK_EX)
    (folder / f"{LOCK}.new").rename(folder / LOCK)
    return file


def remove(folder: Path, process: int, _: object = None) -> None:
    """Remove the folder of a process, unless this one was forked from it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


def remove_orphans(base: Path) -> None:
    """Remove the folders of processes that were killed: those whose lock can be had."""
    if fcntl is None:
        return
    for path in base.glob(f"{PREFIX}*/{LOCK}"):
        with suppress(OSError), path.open("r+") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path.parent, ignore_errors=True)
