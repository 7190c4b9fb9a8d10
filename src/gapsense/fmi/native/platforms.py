"""Platforms that native FMUs are for, and the compilers that make their binaries."""

from __future__ import annotations

import platform
from typing import NamedTuple

from gapsense._os.native import ZIG, NativeError, own_compiler, zig_compiler, zig_version

FLAGS = ("-std=c99", "-O1", "-fvisibility=hidden", "-ffp-contract=off")  # -O2 takes twice as long, for no faster steps
SMALL = ("-Os",)  # besides, for what is not arithmetic
ZIG_FLAGS = ("-fno-sanitize=all", "-Wl,--build-id=none")
SYSTEMS = {"Linux": "linux64", "Windows": "win64", "Darwin": "darwin64"}
WASM = "wasm32-wasip2"  # as the draft FMI-LS-WASM names it; built only if it is asked for
LIKE_X86_64 = ("x86_64", "AMD64", "amd64")


class Binary(NamedTuple):
    """A platform: the place of its binary in an FMU, and the names that Zig has for its processors."""

    folder: str  # in binaries/ of an FMU of FMI 2.0; none, if only FMI 3.0 has this platform
    ending: str
    targets: tuple[str, ...]
    flags: tuple[str, ...] = ("-fPIC",)
    libraries: tuple[str, ...] = ("-lm",)
    linked: str = "-shared"


PLATFORMS = {
    "linux64": Binary("linux64", ".so", ("x86_64-linux-gnu.2.17",)),
    "win64": Binary(folder="win64", ending=".dll", targets=("x86_64-windows-gnu",), flags=(), libraries=()),
    "darwin64": Binary("darwin64", ".dylib", ("x86_64-macos.11.0", "aarch64-macos.11.0")),
    "aarch64-linux": Binary("linux64", ".so", ("aarch64-linux-gnu.2.17",)),  # so hosts of FMI 2.0 look for it
    WASM: Binary(
        folder="",
        ending=".wasm",
        targets=("wasm32-wasi",),
        flags=("-DGAPSENSE_COMPONENT",),
        libraries=(),
        linked="-mexec-model=reactor",
    ),
}


class Compiler(NamedTuple):
    """A command that compiles C for one processor."""

    command: tuple[str, ...]
    binary: Binary
    target: str

    @property
    def flags(self) -> tuple[str, ...]:
        """Options for every source."""
        return (*FLAGS, *self.binary.flags)


def here() -> str | None:
    """Platform of the machine, if native FMUs are made for it."""
    found = SYSTEMS.get(platform.system())
    if found == "linux64" and platform.machine() == "aarch64":
        return "aarch64-linux"
    return found if platform.machine() in LIKE_X86_64 or found == "darwin64" else None


def compilers(name: str) -> list[Compiler]:
    """The compilers of a platform's binary, one for each processor; a NativeError says what to install."""
    binary = PLATFORMS[name]
    if zig_version() == ZIG:
        return [Compiler((*zig_compiler(), "-target", target, *ZIG_FLAGS), binary, target) for target in binary.targets]
    own = own_compiler()
    if name == here() and own:
        return [Compiler(own, binary, "")]
    what = f"`{name}` needs ziglang {ZIG}, found {zig_version() or 'none'}"
    more = "no C compiler is installed either" if name == here() else f"the C compiler here makes only `{here()}`"
    raise NativeError(f"{what}; {more}. Run `pip install ziglang=={ZIG}`.")


def choose_platforms(names: list[str]) -> list[str]:
    """Platforms by name, of which `here` is the machine's own; without names all that can be compiled for here."""
    names = names or ([name for name in PLATFORMS if name != WASM] if zig_version() == ZIG else ["here"])
    own = here() or f"{platform.system()} on {platform.machine()}"
    found = [own if name == "here" else name for name in names]
    if unknown := [name for name in found if name not in PLATFORMS]:
        raise NativeError(f"there is no platform `{', '.join(unknown)}`. There are: {', '.join(PLATFORMS)}.")
    return list(dict.fromkeys(found))
