"""Small C libraries whose Linux binaries are committed: compile them, or check that they belong to their sources.

They are compiled by Zig (`pip install ziglang`), which can build against an old glibc and gives the same bytes on every
machine. This is needed only after a change to C sources. Each binary holds a fingerprint of its sources, so that a
stale one is noticed without a compiler.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ZIG = "0.17.1"  # another version may give other bytes
TARGET = "x86_64-linux-gnu.2.17"  # CentOS 7
FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror")
ZIG_FLAGS = ("-target", TARGET, "-fno-sanitize=all", "-Wl,--build-id=none")


class NativeError(RuntimeError):
    """A library cannot be compiled, or its binary does not belong to its sources."""


def zig_version() -> str | None:
    """Version of the installed Zig compiler, if there is one."""
    from importlib.metadata import PackageNotFoundError, version  # here, so that what compiles nothing starts fast

    try:
        return version("ziglang")
    except PackageNotFoundError:
        return None


def zig_compiler() -> tuple[str, ...]:
    """Command of Zig's C compiler: its program itself, since `python -m` looks into the working folder first."""
    from importlib.metadata import distribution

    return str(distribution("ziglang").locate_file("ziglang/zig")), "cc"


def own_compiler() -> tuple[str, ...] | None:
    """Command of the C compiler of this machine: what `CC` names, or else the first one that is found, or Zig's."""
    if named := shlex.split(os.environ.get("CC", "")):
        return tuple(named) if shutil.which(named[0]) else None
    found = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    return (found,) if found else zig_compiler() if zig_version() else None


@dataclass(frozen=True)
class Library:
    """A C library of one source file, besides headers in the same folder.

    For `x.c` the compiler defines `X_FINGERPRINT`, which the source puts behind `gapsense-x:` into the binary.
    """

    module: str  # that `python -m` runs to build the library
    source: Path
    binary: Path
    exports: tuple[str, ...]  # functions that the binary must export
    options: tuple[str, ...] = ()  # for the compiler
    libraries: tuple[str, ...] = ()  # for the linker, at the end of the command
    headers: Callable[[], Path] | None = None  # gives the folder of headers from elsewhere
    embedded: tuple[str, ...] = ()  # files beside the source whose text is in the binary
    generated: Callable[[], Mapping[str, str]] = dict  # gives the text of headers that are made, by name

    @property
    def flags(self) -> tuple[str, ...]:
        """Options for any compiler."""
        return (*FLAGS, *self.options, "-s")

    def fingerprint(self) -> str:
        """SHA-256 of the C sources, the compiler's version and its options; line ends do not count."""
        digest = hashlib.sha256()
        files = (*sorted(self.source.parent.glob("*.[ch]")), *map(self.source.with_name, self.embedded))
        texts = (*(file.read_text("utf-8") for file in files), *self.generated().values())
        for part in (*texts, ZIG, *ZIG_FLAGS, *self.flags, *self.libraries):
            digest.update(part.encode())
            digest.update(b"\0")
        return digest.hexdigest()

    def compile_with(self, compiler: Sequence[str], destination: Path) -> Path:
        """Compile into `destination` with a command that takes the options of gcc."""
        mark = f'-D{self.source.stem.upper()}_FINGERPRINT="{self.fingerprint()}"'
        include = [f"-I{self.headers()}"] if self.headers else []
        # Relative to the folder, so that its absolute path cannot reach the binary.
        output = ("-o", str(destination.resolve()))
        with tempfile.TemporaryDirectory() as folder:
            for name, text in self.generated().items():
                Path(folder, name).write_text(text, encoding="utf-8")
            command = [*compiler, *self.flags, mark, *include, "-I", folder, self.source.name, *output, *self.libraries]
            done = subprocess.run(command, cwd=self.source.parent, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise NativeError(f"`{compiler[0]}` could not compile `{self.source.name}`:\n{done.stderr.strip()}")
        return destination

    def build(self, destination: Path) -> Path:
        """Compile for old and new Linux systems into the file `destination`."""
        found = zig_version()
        if found != ZIG:
            raise NativeError(
                f"`{self.source.name}` is compiled with ziglang {ZIG}; found {found or 'none'}."
                f" Run `pip install ziglang=={ZIG}`."
            )
        return self.compile_with((*zig_compiler(), *ZIG_FLAGS), destination)

    def problems(self, binary: Path | None = None) -> list[str]:
        """What is wrong with a binary, found without a compiler; empty if it belongs to the sources."""
        binary = binary or self.binary
        again = f"Run `python -m {self.module}`."
        if not binary.is_file():
            return [f"`{binary}` does not exist. {again}"]
        found = []
        if f"gapsense-{self.source.stem}:{self.fingerprint()}".encode() not in binary.read_bytes():
            found.append(f"`{binary}` is not up to date with its sources and options. {again}")
        if sys.platform == "linux" and platform.machine() == "x86_64":
            library = ctypes.CDLL(str(binary))
            if missing := [name for name in self.exports if not hasattr(library, name)]:
                found.append(f"`{binary}` does not export {', '.join(missing)}. {again}")
        return found

    def check(self) -> None:
        """Compare the committed binary with its sources and, where Zig is installed, with a rebuild, byte for byte."""
        found = self.problems()
        if not found and zig_version() == ZIG:
            with tempfile.TemporaryDirectory() as folder:
                rebuilt = self.build(Path(folder) / self.binary.name).read_bytes()
            if rebuilt != self.binary.read_bytes():
                found = [
                    f"`{self.binary}` differs from a rebuild with ziglang {ZIG}. Rebuild it and commit the result."
                ]
        if found:
            raise NativeError("\n".join(found))

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Entry point of `python -m <module>`; returns the exit code."""
        import argparse

        parser = argparse.ArgumentParser(prog=f"python -m {self.module}", description=f"Compile {self.source.name}.")
        parser.add_argument("--check", action="store_true", help="only compare the committed binary with its sources")
        try:
            if parser.parse_args(arguments).check:
                self.check()
                extent = "with a rebuild" if zig_version() == ZIG else f"by fingerprint only, for want of ziglang {ZIG}"
                print(f"{self.binary} is current (compared {extent}).")
            else:
                print(self.build(self.binary))
        except NativeError as error:
            print(error, file=sys.stderr)
            return 1
        return 0


# Structures of C for ctypes, read from the source that declares them.


NUMBERS = {
    "int": ctypes.c_int,
    "ptrdiff_t": ctypes.c_ssize_t,
    "size_t": ctypes.c_size_t,
    "int64_t": ctypes.c_int64,
    "double": ctypes.c_double,
}
TYPEDEF = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
FIELDS = re.compile(r"(?:const )?(\w+) (?:\(\*(\w+)\)\([^)]*\)|([\w*, ]+));")  # a function is a plain address


def structures(source: str, **known: Any) -> dict[str, Any]:
    """The structures that a source declares, by name; one in another, called `block`, shares its fields with that."""
    made: dict[str, Any] = {**NUMBERS, **known}
    for body, name in TYPEDEF.findall(COMMENT.sub("", source)):
        fields = [
            (
                field.lstrip("*"),
                ctypes.c_void_p if function else pointer(made.get(kind)) if "*" in field else made[kind],
            )
            for kind, function, names in FIELDS.findall(body)
            for field in (function or names).split(", ")
        ]
        inner = [field for field, kind in fields if field == "block"]
        made.setdefault(name, type(name, (ctypes.Structure,), {"_anonymous_": inner, "_fields_": fields}))
    return made


def pointer(kind: Any) -> Any:
    """Pointer to a structure or to whole numbers; to anything else a plain address."""
    is_typed = kind is ctypes.c_int or (kind and issubclass(kind, ctypes.Structure))
    return ctypes.POINTER(kind) if is_typed else ctypes.c_void_p
