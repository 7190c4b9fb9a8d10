"""Compile a component's C into one binary for each platform."""

from __future__ import annotations

import struct
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

from gapsense._os.native import NativeError
from gapsense.fmi import describe
from gapsense.fmi.native.platforms import SMALL, Compiler

FAT_MAGIC, FAT_ALIGNMENT = 0xCAFEBABE, 14  # of a library for several processors; 2^14 bytes
PROCESSORS = {"x86_64": (0x01000007, 3), "aarch64": (0x0100000C, 0)}  # type and subtype, as macOS numbers them
PE_HEADER, TIME = 60, 8  # where a library for Windows says where its header is, and the time in that
OWN = ("model.c", "kernel.c", "arrays.c")  # what differs between components


def compile_common(files: Mapping[str, str], compiler: Compiler, work: Path) -> None:
    """Compile what is the same for all components, once, into a folder of `work`."""
    folder = work.resolve() / (compiler.target or "here")
    folder.mkdir()
    put({name: text for name, text in files.items() if name not in OWN}, folder)
    for source in sorted(folder.glob("*.c")):
        _compile(source, compiler, *SMALL)


def binary(files: Mapping[str, str], name: str, compilers: Sequence[Compiler], work: Path) -> bytes:
    """The library of one platform.

    Parameters
    ----------
    files : mapping
        Text of every C source and header.
    name : str
        Of the library, without its ending.
    compilers : sequence
        Of the platform, one for each processor.
    work : Path
        Folder with what `compile_common` made.
    """
    made = {c.target: _library(files, name, c, work.resolve()) for c in compilers}
    return fat(made) if len(made) > 1 else next(iter(made.values()))


def timeless(library: bytes) -> bytes:
    """A library without the time of linking, which the header of a Windows library has."""
    if library[:2] != b"MZ":
        return library
    at = struct.unpack_from("<I", library, PE_HEADER)[0] + TIME
    return library[:at] + bytes(4) + library[at + 4 :]


def fat(libraries: Mapping[str, bytes]) -> bytes:
    """A library of macOS for several processors, by target, from one for each."""
    step = 1 << FAT_ALIGNMENT
    head, body = struct.pack(">II", FAT_MAGIC, len(libraries)), b""
    for target, library in libraries.items():
        body += b"\0" * (-len(body) % step)
        kind = PROCESSORS[target.partition("-")[0]]
        head += struct.pack(">IIIII", *kind, step + len(body), len(library), FAT_ALIGNMENT)
        body += library
    return head.ljust(step, b"\0") + body


def thin(library: bytes) -> dict[str, bytes]:
    """The libraries in one of `fat`, by processor."""
    found = {}
    for k in range(struct.unpack_from(">I", library, 4)[0]):
        *kind, start, length, _ = struct.unpack_from(">IIIII", library, 8 + 20 * k)
        found[next(name for name, own in PROCESSORS.items() if own == tuple(kind))] = library[start : start + length]
    return found


def _library(files: Mapping[str, str], name: str, compiler: Compiler, work: Path) -> bytes:
    common = sorted((work / (compiler.target or "here")).glob("*.o"))
    with tempfile.TemporaryDirectory(dir=work) as temporary:
        folder = Path(temporary)
        put({file: text for file, text in files.items() if file in OWN or file.endswith(".h")}, folder)
        own = [_compile(folder / file, compiler) for file in OWN]
        library = folder / f"{name}{compiler.binary.ending}"
        # Else a library for macOS holds the path of this folder.
        called = (f"-Wl,-install_name,@rpath/{library.name}",) if library.suffix == ".dylib" else ()
        platform, objects = compiler.binary, map(str, (*common, *own))
        link = (platform.linked, "-s", *called, *objects, "-o", str(library), *platform.libraries)
        run((*compiler.command, *link), library.name)
        made = timeless(library.read_bytes())
        return component(made) if library.suffix == ".wasm" else made


def put(files: Mapping[str, str], folder: Path) -> None:
    """Write files into a folder."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def _compile(source: Path, compiler: Compiler, *more: str) -> Path:
    """An object file; by its full path, because Zig's cache takes sources of one relative path for the same."""
    made = source.with_suffix(".o")
    run((*compiler.command, *compiler.flags, *more, "-c", str(source), "-o", str(made)), source.name)
    return made


def run(command: tuple[str, ...], what: str) -> None:
    """Run a compiler. If it fails, a NativeError has its message."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise NativeError(f"`{what}` could not be compiled by `{' '.join(command[:4])}`:\n{done.stderr.strip()}")


# WebAssembly components as the working draft FMI-LS-WASM has them: a module of an FMU in the shell around it.


FOLDER = Path(__file__).with_name("wasm")
MODULE = b"\x01"  # the kind of a component's section that holds a module
EMPTY = MODULE + b"\x08\x00asm\x01\x00\x00\x00"  # such a section, in place of the FMU's
RESOURCES = b"resource-dir-callbacks"  # what a module imports that reads files of its FMU
DRAFT = {
    "fmi-ls-name": "org.modelica.fmi-ls-wasm",
    "fmi-ls-version": "0.1.0",
    "fmi-ls-description": "FMI Layered Standard for WebAssembly",
}
SCHEMA = "http://fmi-standard.org/fmi-ls-manifest"


def component(module: bytes) -> bytes:
    """The component of a module."""
    shell = FOLDER / ("shell_resources.wasm" if RESOURCES in module else "shell.wasm")
    before, after = shell.read_bytes().split(EMPTY)
    return before + MODULE + leb128(len(module)) + module + after


def leb128(number: int) -> bytes:
    """A non-negative number as WebAssembly writes it."""
    high, low = divmod(number, 128)
    return bytes([low | 128]) + leb128(high) if high else bytes([low])


def manifest() -> bytes:
    """`manifest.xml` of the layered standard."""
    about = {f"fmi-ls:{name}": value for name, value in DRAFT.items()}
    return describe.text(Element("fmiLayeredStandardManifest", {"xmlns": SCHEMA, "xmlns:fmi-ls": SCHEMA, **about}))
