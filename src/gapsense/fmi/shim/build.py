"""Compile the shim: `python -m gapsense.fmi.shim.build`; or see if the committed binary is current: `--check`.

Zig's C compiler (`pip install ziglang`) makes it, because it can build against an old glibc and gives the same bytes on
every machine. The FMI headers are those that FMPy ships. Needed only after a change to the C sources.
"""

from __future__ import annotations

import argparse
import ctypes
import hashlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from gapsense.fmi.shim import BINARY, SOURCE

ZIG = "0.17.1"  # another version may give other bytes
TARGET = "x86_64-linux-gnu.2.17"  # CentOS 7; the wrapper behind the shim asks for much more
FLAGS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"),
    *("-Wall", "-Wextra", "-Werror", "-Wl,-z,nodelete", "-s"),
)
LIBRARIES = ("-ldl", "-lpthread")  # part of libc since glibc 2.34
ZIG_FLAGS = ("-target", TARGET, "-fno-sanitize=all", "-Wl,--build-id=none")
CALLS = SOURCE.with_name("calls.h")


class ShimError(RuntimeError):
    """The shim cannot be compiled, or its binary does not belong to its sources."""


def fingerprint() -> str:
    """SHA-256 of the C sources, the compiler's version and its options; line ends do not count."""
    digest = hashlib.sha256()
    texts = (file.read_text("utf-8") for file in sorted(SOURCE.parent.glob("*.[ch]")))
    for part in (*texts, ZIG, *ZIG_FLAGS, *FLAGS, *LIBRARIES):
        digest.update(part.encode())
        digest.update(b"\0")
    return digest.hexdigest()


def headers() -> Path:
    """Folder with `fmi2Functions.h`, inside the installed FMPy."""
    spec = find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise ShimError("The FMI headers come from FMPy, which is not installed. Run `pip install fmpy`.")
    folder = Path(spec.origin).parent / "c-code"
    if not (folder / "fmi2Functions.h").is_file():
        raise ShimError(f"`{folder}` has no `fmi2Functions.h`. Install FMPy 0.3.32, which ships it.")
    return folder


def compile_with(compiler: Sequence[str], destination: Path) -> Path:
    """Compile the shim into `destination` with a command that takes the options of gcc."""
    mark = f'-DSHIM_FINGERPRINT="{fingerprint()}"'
    # Relative to the folder, so that its absolute path cannot reach the binary.
    output = ("-o", str(destination.resolve()))
    command = [*compiler, *FLAGS, mark, f"-I{headers()}", SOURCE.name, *output, *LIBRARIES]
    done = subprocess.run(command, cwd=SOURCE.parent, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ShimError(f"`{compiler[0]}` could not compile the shim:\n{done.stderr.strip()}")
    return destination


def zig_version() -> str | None:
    """Version of the installed Zig compiler, if there is one."""
    try:
        return version("ziglang")
    except PackageNotFoundError:
        return None


def build(destination: Path) -> Path:
    """Compile the shim for old and new Linux systems into the file `destination`."""
    found = zig_version()
    if found != ZIG:
        raise ShimError(
            f"The shim is compiled with ziglang {ZIG}; found {found or 'none'}. Run `pip install ziglang=={ZIG}`."
        )
    return compile_with((sys.executable, "-m", "ziglang", "cc", *ZIG_FLAGS), destination)


def exported() -> list[str]:
    """Names of all functions that the shim must export."""
    forwarded = re.findall(r"^CALL\((\w+),", CALLS.read_text("utf-8"), flags=re.MULTILINE)
    written_out = re.findall(r"^FMI2_Export [^=]*?(fmi2\w+)\(", SOURCE.read_text("utf-8"), flags=re.MULTILINE)
    return sorted({*forwarded, *written_out})


def problems(binary: Path = BINARY) -> list[str]:
    """What is wrong with `binary`, found without a compiler; empty if it belongs to the sources."""
    again = "Run `python -m gapsense.fmi.shim.build`."
    if not binary.is_file():
        return [f"`{binary}` does not exist. {again}"]
    found = []
    if f"gapsense-shim:{fingerprint()}".encode() not in binary.read_bytes():
        found.append(f"`{binary}` was not made from the present sources and options. {again}")
    if sys.platform == "linux":
        library = ctypes.CDLL(str(binary))
        missing = [name for name in exported() if not hasattr(library, name)]
        if missing:
            found.append(f"`{binary}` does not export {', '.join(missing)}. {again}")
    return found


def check() -> None:
    """Compare the committed binary with its sources and, where Zig is installed, with a rebuild, byte for byte."""
    found = problems()
    if not found and zig_version() == ZIG:
        with tempfile.TemporaryDirectory() as folder:
            rebuilt = build(Path(folder) / BINARY.name).read_bytes()
        if rebuilt != BINARY.read_bytes():
            found = [f"`{BINARY}` differs from a rebuild with ziglang {ZIG}. Rebuild it and commit the result."]
    if found:
        raise ShimError("\n".join(found))


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m gapsense.fmi.shim.build", description="Compile the FMU shim.")
    parser.add_argument("--check", action="store_true", help="only compare the committed binary with its sources")
    try:
        if parser.parse_args(arguments).check:
            check()
            extent = "with a rebuild" if zig_version() == ZIG else f"by fingerprint only, for want of ziglang {ZIG}"
            print(f"{BINARY} is current (compared {extent}).")
        else:
            print(build(BINARY))
    except ShimError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
