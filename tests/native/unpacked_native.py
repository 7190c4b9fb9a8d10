"""Native FMUs taken apart: their library run by the plain host, their C called by itself."""

from __future__ import annotations

import csv
import struct
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from parts import Part

from gapsense.fmi.shim.build import headers

HERE = Path(__file__).parent
STRICT = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function")


class Unpacked(NamedTuple):
    """An FMU in a folder."""

    folder: Path
    guid: str
    fmi: int = 2

    @property
    def resources(self) -> str:
        """Location of the resources, as a host gives it: an URI, or in FMI 3.0 a path."""
        folder = self.folder / "resources"
        return folder.as_uri() if self.fmi == 2 else f"{folder}/"

    def library(self, ending: str = ".so", platform: str = "*") -> Path:
        """The binary of a platform."""
        return next(self.folder.glob(f"binaries/{platform}/*{ending}"))


def unpack(fmu: Path, folder: Path) -> Unpacked:
    """Extract an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    about = ElementTree.parse(folder / "modelDescription.xml").getroot().attrib
    return Unpacked(folder, about["guid"]) if "guid" in about else Unpacked(folder, about["instantiationToken"], 3)


def compiled_host(compiler: Sequence[str], to: Path, *more: str, source: str = "host.c") -> Path:
    """The plain host in C, or that of FMI 3.0, host3.c."""
    libraries = () if to.suffix == ".exe" or sys.platform != "linux" else ("-ldl",)
    # -s, as native FMUs have it: without it Zig makes its C library for Windows once more, in 100 s of CPU
    options = ("-std=c99", "-O2", "-s", "-Wall", "-Wextra", f"-I{headers()}")
    command = [*compiler, *options, *more, str(HERE / source), "-o", str(to), *libraries]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return to


def outputs(
    command: Sequence[object], fmu: Unpacked, part: Part, ending: str = ".so", platform: str = "*"
) -> list[list[float]]:
    """What the host gets of the FMU on the inputs of its reference run."""
    counts = len(part.component.of("input")), len(part.component.of("output"))
    words = (fmu.library(ending, platform), fmu.guid, fmu.resources, part.folder / "reference.csv", *counts)
    done = subprocess.run([*map(str, (*command, *words))], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [[float(value) for value in line.split()] for line in done.stdout.splitlines()]


def expected(part: Part) -> list[list[float]]:
    """The outputs of the reference run."""
    first = 1 + len(part.component.of("input"))
    with (part.folder / "reference.csv").open(newline="", encoding="utf-8") as file:
        return [[float(value) for value in row[first:]] for row in list(csv.reader(file))[1:]]


def bits(rows: Sequence[Sequence[float]]) -> list[bytes]:
    """Numbers as bytes, in which zeros of different sign differ."""
    return [struct.pack(f"{len(row)}d", *row) for row in rows]
