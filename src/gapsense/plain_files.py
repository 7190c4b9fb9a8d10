"""What is a file that can be read to its end, what a file may be called, and who may read a new one."""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path

FOREIGN = frozenset('<>:"/\\|?*')  # characters
DEVICE = re.compile(
    r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9\u00b9\u00b2\u00b3])(\..*)?", re.IGNORECASE
)  # of Windows
LONGEST_NAME = 150  # bytes, so that there is room for what results have in front and behind
UNBLOCKED = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # does not wait for bytes
LARGEST = 2 * 10**9  # bytes of a file that is read at once
KINDS = {
    stat.S_IFDIR: "a folder",
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
        raise OSError(errno.EINVAL, "no file can have this name", str(path)) from None
    if not stat.S_ISREG(about.st_mode):
        found = KINDS.get(stat.S_IFMT(about.st_mode), "something else")
        raise OSError(errno.EINVAL, f"it is {found}, a file is expected", str(path))
    with os.fdopen(os.open(path, UNBLOCKED), "rb") as file:  # files of the system may have more than their size
        content = (file.read(most + 1) if about.st_size <= most else None) or b""
    if max(len(content), about.st_size) > most:
        raise OSError(errno.EINVAL, f"it has more than {most / 1e6:.9g} MB, which is too large", str(path))
    return content


def unfit(name: str, foreign: frozenset[str] = FOREIGN) -> str:
    """Why a file cannot have a name on every system, or nothing."""
    if not name.isprintable() or foreign.intersection(name):
        return "has characters that file names do not have everywhere"
    if DEVICE.fullmatch(name) or name.endswith((".", " ")) or name.startswith(("-", " ")):
        return "is one that commands or systems take for something else"
    return f"is longer than {LONGEST_NAME} bytes" if len(name.encode("utf-8", "replace")) > LONGEST_NAME else ""


def mask() -> int:
    """Rights that new files do not get, which temporary ones do not follow by themselves."""
    os.umask(found := os.umask(0))
    return found
