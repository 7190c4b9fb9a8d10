"""What is a file that can be read to its end, what a file may be called, and who may read a new one."""

from __future__ import annotations

import errno
import os
import re
import stat
import tempfile
from collections.abc import Iterable
from itertools import takewhile
from pathlib import Path

from gapsense.problems import InputError

FOREIGN = frozenset('<>:"/\\|?*')  # characters
DEVICE = re.compile(
    r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9\u00b9\u00b2\u00b3])(\..*)?", re.IGNORECASE
)  # of Windows
LONGEST_NAME = 150  # bytes, so that there is room for what results have in front and behind
UNBLOCKED = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # does not wait for bytes
LARGEST = 2 * 10**9  # bytes of a file that is read at once
NAME_MAX = 255  # bytes of a name, of most systems
FILE, FOLDER = "a file", "a folder"
KINDS = {
    stat.S_IFDIR: FOLDER,
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def read_bytes(path: Path, most: int = LARGEST) -> bytes:
    """Content of a file; an OSError refuses what is none, before it is opened, and what is too large.

    A pipe or a device may give bytes for ever, or none.
    """
    try:
        about = path.stat()
    except ValueError:  # a NUL character in its name
        raise OSError(errno.EINVAL, "a file cannot have this name", str(path)) from None
    if not stat.S_ISREG(about.st_mode):
        found = KINDS.get(stat.S_IFMT(about.st_mode), "something else")
        raise OSError(errno.EINVAL, f"it is {found}, a file is expected", str(path))
    with os.fdopen(os.open(path, UNBLOCKED), "rb") as file:  # files of the system may have more than their size
        content = (file.read(most + 1) if about.st_size <= most else None) or b""
    if max(len(content), about.st_size) > most:
        raise OSError(errno.EINVAL, f"it has more than {most / 1e6:.9g} MB, which is too large", str(path))
    return content


def refuse_unwritable(*files: Path, folders: Iterable[Path] = ()) -> None:
    """Raise an InputError that tells which files and folders cannot be written, before anything is done for them."""
    reasons: dict[str, Path] = {}  # each is told once
    for path, is_folder in (*((file, False) for file in files), *((folder, True) for folder in folders)):
        reasons.setdefault(unwritable(path, is_folder), path)
    if problems := [f"`{p}` cannot be written: {why}. Choose another place." for why, p in reasons.items() if why]:
        raise InputError(problems)


def unwritable(path: Path, is_folder: bool = False) -> str:
    """Why nothing can be written to a file, or into a folder, that may have to be made; or nothing.

    Rights do not tell, so a file without a name is made where the new ones would be.
    """
    place = path if is_folder else path.parent
    try:
        if not is_folder and kind(path) not in ("", FILE):
            return f"it is {kind(path)}, a file is expected"
        missing = [*takewhile(lambda folder: not kind(folder), (place, *place.parents))]
        place = missing[-1].parent if missing else place
        if kind(place) != FOLDER:
            return f"`{place}` is {kind(place)}, a folder is expected"
        if any(len(os.fsencode(folder.name)) > NAME_MAX for folder in (path, *missing)):
            return f"a name in it is longer than {NAME_MAX} bytes"
        with tempfile.TemporaryFile(dir=place):
            return ""
    except OSError as error:
        return f"no new file can be made in `{place}` ({error.strerror})"


def kind(path: Path) -> str:
    """What is at a path: a file, a folder, or something else; nothing if there is nothing."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "a broken link" if path.is_symlink() else ""
    return FILE if stat.S_ISREG(mode) else KINDS.get(stat.S_IFMT(mode), "something else")


def unfit(name: str, foreign: frozenset[str] = FOREIGN) -> str:
    """Why a file cannot have a name on every system, or nothing."""
    if not name.isprintable() or foreign.intersection(name):
        return "has characters that some systems do not allow in file names"
    if DEVICE.fullmatch(name) or name.endswith((".", " ")) or name.startswith(("-", " ")):
        return "has another meaning to commands or to some systems"
    return f"is longer than {LONGEST_NAME} bytes" if len(name.encode("utf-8", "replace")) > LONGEST_NAME else ""


def mask() -> int:
    """Rights that new files do not get, which temporary ones do not follow by themselves."""
    os.umask(found := os.umask(0))
    return found
