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

from gapsense._os.files import sha256
from gapsense._os.locks import temporary_folder as locked_folder
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.run.failure import FmuError

PLAIN = re.compile(r"[A-Za-z0-9_./:\\~-]+")


def unpacked(description: Description) -> Path:
    """Folder with what a run needs of an FMU, until the process ends."""
    folder = home(os.getpid()) / description.sha256
    if not folder.is_dir():
        if sha256(description.path) != description.sha256:
            raise FmuError(description.name, f"`{description.path}` has changed since it was read. Start again.")
        part = Path(tempfile.mkdtemp(dir=folder.parent))
        try:
            with zipfile.ZipFile(description.path) as archive:
                archive.extractall(part, [name for name in archive.namelist() if is_needed(name)])
        except (OSError, zipfile.BadZipFile) as error:
            shutil.rmtree(part, ignore_errors=True)
            cause = getattr(error, "strerror", None) or error
            why = f"`{description.path}` cannot be unpacked into `{folder.parent}`: {cause}"
            raise FmuError(description.name, f"{why}. Look at the file and at the space on that disk.") from error
        with suppress(OSError):  # another thread was faster
            part.rename(folder)
    return folder


def is_needed(member: str) -> bool:
    """True unless no run needs it: documentation, sources, binaries of other platforms."""
    import fmpy  # here, so that what loads no FMU starts fast

    folder, *inner = member.split("/")
    is_foreign = folder == "binaries" and len(inner) > 1 and inner[0] not in (fmpy.platform, fmpy.platform_tuple)
    return folder not in ("documentation", "sources") and not is_foreign


@cache
def home(process: int) -> Path:
    """Folder for what this process unpacks; it is removed with it, or else by the next one."""
    folder = temporary_folder()
    atexit.register(remove, folder, process)
    return folder


def temporary_folder() -> Path:
    """A new folder with a plain ASCII path: FMUs may fail on any other, see section 1 of hosts.md."""
    for base in (None, Path("/tmp"), Path()):
        folder = locked_folder(base).resolve()
        if PLAIN.fullmatch(str(folder)):
            return folder
        shutil.rmtree(folder)
    raise FmuError("fmus", "no temporary folder has a plain ASCII path. Set TMPDIR to one that has.")


def remove(folder: Path, process: int) -> None:
    """Remove the folder of a process, unless this one was forked from it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)
