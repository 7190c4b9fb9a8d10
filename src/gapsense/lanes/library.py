"""C of functions over runs: compiled for the processor of this machine once, and kept for the next time.

Nobody needs a compiler: without one, or where it fails, `loaded` says so once and gives None.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from gapsense.lanes.code import Code
from gapsense.locks import temporary_folder
from gapsense.native import NO_FOLDING, NativeError, own_compiler

HERE = Path(__file__).resolve().parent
FLAGS = ("-std=gnu11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-flax-vector-conversions", *NO_FOLDING, "-w")
FOR_THIS = (("-march=native",), ("-mcpu=native",), ())  # the first that a compiler knows
SHARED = ("-shared",) if sys.platform == "win32" else ("-fPIC", "-shared")
ENDING = ".dll" if sys.platform == "win32" else ".so"
CACHE = "GAPSENSE_CACHE"  # the folder, for who wants another
OLD = 90 * 86400.0  # seconds after which what was not used is removed
INSTEAD = "Numpy computes instead, several times slower, and its logarithms may differ in the last bit."


def source(codes: Sequence[Code]) -> str:
    """C of all functions and of what calls them."""
    head, tail = ((HERE / name).read_text(encoding="utf-8") for name in ("lanes.h", "run.c"))
    names = [f"f{k}" for k in range(len(codes))]
    functions = [code.c.text.replace("void NAME(", f"void {name}(", 1) for name, code in zip(names, codes)]
    return "\n".join([head, *functions, f"#define FUNCTIONS {', '.join(names)}", tail])


@cache
def loaded(text: str) -> ctypes.CDLL | None:
    """The library of a source; None, with a warning, where there is none."""
    try:
        return ctypes.CDLL(str(built(text)))
    except (OSError, NativeError) as error:
        _tell(f"{error} {INSTEAD}")
        return None


@cache
def _tell(sentence: str) -> None:
    """Warn of the same thing once."""
    warnings.warn(sentence, stacklevel=2)


def built(text: str) -> Path:
    """File of the library; where the cache cannot be written it is for this process only."""
    compiler = own_compiler()
    if not compiler:
        raise NativeError("No C compiler is found: neither what `CC` names, nor `cc`, `gcc` or `clang`.")
    flags, about = tuned(compiler)
    digest = hashlib.sha256("\0".join([text, *compiler, *flags, about]).encode()).hexdigest()
    name = f"lanes-{digest}{ENDING}"
    kept = cache_folder() / name
    try:
        if kept.is_file():
            os.utime(kept)
        else:
            compiled(text, (*compiler, *flags), kept)
    except OSError:
        kept = kept if kept.is_file() else compiled(text, (*compiler, *flags), own_folder() / name)
    return kept


@cache
def tuned(compiler: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """Options for this processor, and all that the compiler then says of itself and of the processor."""
    for more in FOR_THIS:
        with suppress(NativeError):
            return (*FLAGS, *more), run((*compiler, *FLAGS, *more, "-dM", "-E", "-x", "c", os.devnull))
    raise NativeError(f"`{' '.join(compiler)}` is no compiler like gcc.")


def compiled(text: str, command: Sequence[str], file: Path) -> Path:
    """Compile a source into a file, which is complete or absent."""
    file.parent.mkdir(parents=True, exist_ok=True)
    tidy(file.parent)
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        part = Path(folder) / file.name
        part.with_suffix(".c").write_text(text, encoding="utf-8")
        run((*command, *SHARED, str(part.with_suffix(".c")), "-o", str(part), *(() if ENDING == ".dll" else ("-lm",))))
        part.replace(file)
    return file


def run(command: Sequence[str]) -> str:
    """What a command says; a NativeError with the first lines that tell why it failed."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise NativeError(f"`{command[0]}` does not start: {error}.") from error
    if done.returncode:
        raise NativeError(f"`{command[0]}` could not compile: {' '.join(done.stderr.split())[:300]}")
    return done.stdout


def cache_folder() -> Path:
    """Folder for what is worth keeping between processes."""
    if named := os.environ.get(CACHE):
        return Path(named)
    home = Path("~").expanduser()
    usual = {"win32": home / "AppData" / "Local", "darwin": home / "Library" / "Caches"}.get(sys.platform)
    return Path(os.environ.get("XDG_CACHE_HOME") or usual or home / ".cache") / "gapsense"


@cache
def own_folder() -> Path:
    """Folder of this process."""
    return temporary_folder()


def tidy(folder: Path) -> None:
    """Remove what has not been used for long."""
    for path in folder.iterdir():
        with suppress(OSError):
            if path.stat().st_mtime < time.time() - OLD:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
