"""C of functions over runs: compiled once for the processor of this machine, and kept for everything that calls it.

No compiler is required: if there is none, or if it fails, `loaded` says so once and returns None.

What is loaded runs with the rights of the user. So the cache is a folder that nobody else can write, and the name of a
file in it holds a hash of its content. A file that was cut, changed or exchanged is compiled again.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path

from gapsense._os.locks import CACHE, FACTS, cache_folder, temporary_folder
from gapsense._os.native import NativeError, own_compiler
from gapsense.kernels.emit.lanes import same_over_runs
from gapsense.kernels.lanes.code import Code

HERE = Path(__file__).resolve().parent
FLAGS = ("-std=gnu11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-flax-vector-conversions", "-w")
FOR_THIS = (("-march=native",), ("-mcpu=native",), ())  # the first that a compiler knows
SHARED = ("-shared",) if sys.platform == "win32" else ("-fPIC", "-shared")
PREFIX = "lanes-"  # of all our files in the cache
ENDING = ".dll" if sys.platform == "win32" else ".so"
COMPILERS_AT_ONCE = 2
TELLING = threading.Lock()
OLD = 90 * 86400.0  # seconds after which what was not used is removed
PRIVATE = 0o700  # mode of what is ours
own_folder = cache(temporary_folder)  # of this process
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
ELSEWHERE = f"Nothing is kept there, so each process compiles again. `{CACHE}` can name another folder."
INSTEAD = (
    "Python computes instead, 10 to 1000 times slower, with the same bits; `pip install ziglang` brings a compiler."
)


def addresses(codes: Iterable[Code]) -> list[int] | None:
    """Where functions are in memory, each in a library of its own; None where no compiler is."""
    texts = [source(code) for code in codes]
    with ThreadPoolExecutor(COMPILERS_AT_ONCE) as pool:
        libraries = [*pool.map(load_library, texts)]
    return [address(library, "NAME") for library in libraries if library] if all(libraries) else None


def address(library: ctypes.CDLL, name: str) -> int:
    """Where a function of a library is."""
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0


def source(code: Code) -> str:
    """C of a function, which is called `NAME` outside too, and of what it calls."""
    text = code.c.text.replace("static void NAME(", "void NAME(", 1)
    return with_types("\n".join([*same_over_runs(text), text]))


def with_types(text: str) -> str:
    """C behind the header that it needs."""
    return "\n".join([(HERE / "lanes.h").read_text(encoding="utf-8"), text])


@cache
def load_library(text: str) -> ctypes.CDLL | None:
    """Load the library of a source; None, with a warning, where there is none."""
    try:
        return ctypes.CDLL(str(build_library(text)))
    except (OSError, NativeError) as error:
        _tell(f"{error} {INSTEAD}")
        return None


def _tell(sentence: str) -> None:
    """Warn of the same thing once, whichever thread finds it; its place in the program would not help."""
    with TELLING:
        _warn(sentence)


@cache
def _warn(sentence: str) -> None:
    warnings.warn_explicit(sentence, UserWarning, "gapsense", 1)


def build_library(text: str) -> Path:
    """File of the library; where the cache cannot be written it is for this process only."""
    compiler = own_compiler()
    if not compiler:
        raise NativeError(
            "No C compiler is found, neither the one that `CC` names nor `cc`, `gcc`, `clang` or ziglang's."
        )
    flags, about = tuning_options(compiler)
    digest = hashlib.sha256("\0".join([text, *compiler, *flags, about]).encode()).hexdigest()
    with suppress(OSError):
        folder = cache_folder()
        folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
        if not (why := why_distrusted(folder)):
            return intact(folder, digest) or compile_library(text, (*compiler, *flags), folder, digest)
        _tell(f"{why} {ELSEWHERE}")
    return intact(own_folder(), digest) or compile_library(text, (*compiler, *flags), own_folder(), digest)


@cache
def tuning_options(compiler: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """Options for this processor, and all that the compiler then says of itself and of the processor."""
    for more in FOR_THIS:
        with suppress(NativeError):
            return (*FLAGS, *more), run((*compiler, *FLAGS, *more, "-dM", "-E", "-x", "c", os.devnull))
    raise NativeError(f"`{' '.join(compiler)}` is not a compiler like gcc.")


def why_distrusted(folder: Path) -> str:
    """Say why others could put a library of theirs into a folder; empty if they cannot.

    A folder that has nothing but libraries of ours becomes one that only its owner can read.
    """
    if os.name != "posix":
        return ""
    if folder.lstat().st_uid not in trusted_users():
        return f"`{folder}` belongs to another user."
    real, found = folder.resolve(), folder.stat()
    if found.st_uid not in trusted_users():
        return f"`{folder}` belongs to another user."
    if found.st_mode & OTHERS_WRITE:
        return f"`{folder}` can be written by other users: run `chmod 700` on it."
    for parent in real.parents:
        mode = parent.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"`{folder}` is in `{parent}`, to which everybody can write."
    with suppress(OSError):
        if all(entry.name.startswith((PREFIX, FACTS)) for entry in real.iterdir()):
            real.chmod(PRIVATE)
    return ""


def trusted_users() -> tuple[int, ...]:
    """Users whose files may be loaded: one's own, and the one who can do everything anyway."""
    return os.geteuid(), 0


def intact(folder: Path, digest: str) -> Path | None:
    """The file of a library, if there is one as it was compiled."""
    for file in sorted(folder.glob(f"{PREFIX}{digest}*{ENDING}")):
        if file.name == file_name(digest, content_of(file)):
            with suppress(OSError):
                os.utime(file)
            return file
    return None


def content_of(file: Path) -> bytes:
    """Content of a file; nothing if it is not one, or if others can change it."""
    found = file.lstat()
    if not stat.S_ISREG(found.st_mode):
        return b""
    if os.name == "posix" and (found.st_uid not in trusted_users() or found.st_mode & OTHERS_WRITE):
        _tell(f"`{file}` belongs to other users or can be written by them, so it is not loaded but compiled again.")
        return b""
    return file.read_bytes()


def file_name(digest: str, content: bytes) -> str:
    """Name of the file of a library."""
    return f"{PREFIX}{digest}-{hashlib.sha256(digest.encode() + content).hexdigest()[:32]}{ENDING}"


def compile_library(text: str, command: Sequence[str], folder: Path, digest: str) -> Path:
    """Compile a source into a file of a folder, which is complete or absent."""
    tidy(folder)
    with tempfile.TemporaryDirectory(dir=folder, prefix=PREFIX) as work:
        part = Path(work) / f"{PREFIX}{digest}{ENDING}"
        part.with_suffix(".c").write_text(text, encoding="utf-8")
        run((*command, *SHARED, str(part.with_suffix(".c")), "-o", str(part), *(() if ENDING == ".dll" else ("-lm",))))
        part.chmod(PRIVATE)
        file = folder / file_name(digest, part.read_bytes())
        if file.is_dir() and not file.is_symlink():
            shutil.rmtree(file)
        return part.replace(file)


def run(command: Sequence[str]) -> str:
    """What a command says; a NativeError with the first lines that tell why it failed."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise NativeError(f"`{command[0]}` does not start: {error}.") from error
    if done.returncode:
        raise NativeError(f"`{command[0]}` could not compile: {' '.join(done.stderr.split())[:300]}")
    return done.stdout


def tidy(folder: Path) -> None:
    """Remove what of ours has not been used for long, or was left by a process that was killed."""
    for path in folder.glob(f"{PREFIX}*"):
        with suppress(OSError):
            if path.stat().st_mtime < time.time() - OLD:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
