"""WebAssembly components as the working draft FMI-LS-WASM has them: a module of an FMU in the shell around it.

The shell is that of the interface `wasm/fmi3.wit`, and the same for all FMUs: `wasm/shell.mjs` makes it. Our modules
import nothing but what the draft lets a host provide, and no WASI at all.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from gapsense.fmi import describe

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
    """A number that is not negative, as WebAssembly writes it."""
    high, low = divmod(number, 128)
    return bytes([low | 128]) + leb128(high) if high else bytes([low])


def manifest() -> bytes:
    """`manifest.xml` of the layered standard."""
    about = {f"fmi-ls:{name}": value for name, value in DRAFT.items()}
    return describe.text(Element("fmiLayeredStandardManifest", {"xmlns": SCHEMA, "xmlns:fmi-ls": SCHEMA, **about}))
