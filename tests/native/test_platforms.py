"""Native FMUs for other platforms: all in one FMU of FMI 3.0, small, and the same bytes in every build.

Those of FMI 2.0 run under emulators in tests/conformance/test_hosts.py.
"""

from __future__ import annotations

import filecmp
import os
import shutil
import struct
import sys
import zipfile
from functools import partial
from pathlib import Path

import pytest
from drivers import ROOT, WINE
from parts import FOLDERS, LARGEST, Part
from unpacked_native import bits, compiled_host, expected, outputs, unpack

from gapsense.fmi.components import load_component
from gapsense.fmi.native import package
from gapsense.fmi.native.compile import FAT_ALIGNMENT, FAT_MAGIC, fat, timeless
from gapsense.fmi.native.platforms import FLAGS, PLATFORMS, WASM

ZIG_CC = (sys.executable, "-m", "ziglang", "cc", "-target")
AARCH64 = Path("/usr/aarch64-linux-gnu")
OF_FMI_3 = ("drive_voltage", "semera")  # the library is that of FMI 2.0


@pytest.fixture(scope="session")
def windows(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command of a host of FMI 3.0 on Windows."""
    wine = shutil.which("wine")
    if not wine:
        pytest.skip("no wine, which runs programs for Windows")
    os.environ |= WINE
    host = tmp_path_factory.mktemp("wine") / "host3.exe"
    return [wine, str(compiled_host((*ZIG_CC, "x86_64-windows-gnu"), host, source="host3.c"))]


@pytest.fixture(scope="session")
def aarch64(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command of a host of FMI 3.0 on aarch64."""
    qemu = shutil.which("qemu-aarch64-static") or shutil.which("qemu-aarch64")
    if not qemu or not AARCH64.is_dir():
        pytest.skip("no qemu-user-static or no libc6-arm64-cross, which run programs for aarch64")
    host = tmp_path_factory.mktemp("aarch64") / "host3"
    return [qemu, "-L", str(AARCH64), str(compiled_host((*ZIG_CC, "aarch64-linux-gnu.2.17"), host, source="host3.c"))]


def part_of(folder: Path, fmus: Path) -> Part:
    component = load_component(folder)
    return Part(folder, component, fmus / f"{component.name}.fmu")


@pytest.mark.slow
@pytest.mark.parametrize("folder", [f for f in FOLDERS if f.name in OF_FMI_3], ids=lambda folder: folder.name)
def test_fmi_3_has_all_platforms_in_one_fmu(
    folder: Path, everywhere: Path, windows: list[str], aarch64: list[str], tmp_path: Path
) -> None:
    part = part_of(folder, everywhere / "fmi3")
    fmu, wanted = unpack(part.path, tmp_path), bits(expected(part))
    assert bits(outputs(windows, fmu, part, ".dll", "x86_64-windows")) == wanted
    assert bits(outputs(aarch64, fmu, part, ".so", "aarch64-linux")) == wanted


@pytest.mark.slow
def test_fmus_for_two_platforms_are_small(everywhere: Path) -> None:
    sizes = {path.name: size_without_macos(path) for path in everywhere.glob("*.fmu")}
    assert len(sizes) == len(FOLDERS)
    assert {name: size for name, size in sizes.items() if size >= LARGEST} == {}


def size_without_macos(path: Path) -> int:
    with zipfile.ZipFile(path) as fmu:
        left_out = [item.compress_size for item in fmu.infolist() if item.filename.startswith("binaries/darwin64/")]
    assert len(left_out) == 1
    return path.stat().st_size - left_out[0]


@pytest.mark.slow
def test_a_second_build_gives_the_same_bytes(everywhere: Path, tmp_path: Path) -> None:
    """For all platforms, in other folders and at another time."""
    built = partial(package.build, [ROOT / "fmus" / "semera"], values={})
    second = [path for _, path in built(tmp_path, [name for name in PLATFORMS if name != WASM])]
    assert len(second) == 3
    for path in second:  # the first is in every release, that of WebAssembly is in none
        assert filecmp.cmp(path, everywhere / path.relative_to(tmp_path), shallow=False)
    [(_, one)], [(_, other)] = (built(tmp_path / name, [WASM]) for name in ("one", "other"))
    assert filecmp.cmp(one, other, shallow=False)


@pytest.mark.slow
def test_macos_library_holds_both_processors(everywhere: Path, tmp_path: Path) -> None:
    """It cannot be run here."""
    library = unpack(everywhere / "Semera.fmu", tmp_path / "unpacked").library(".dylib").read_bytes()
    magic, count = struct.unpack_from(">II", library)
    assert (magic, count) == (FAT_MAGIC, 2)
    for k, processor in enumerate((0x01000007, 0x0100000C)):
        kind, _, offset, size, alignment = struct.unpack_from(">IIIII", library, 8 + 20 * k)
        assert (kind, alignment) == (processor, FAT_ALIGNMENT)
        assert struct.unpack_from("<II", library, offset) == (0xFEEDFACF, processor)
        assert offset % (1 << FAT_ALIGNMENT) == 0 and offset + size <= len(library)
        assert b"_fmi2DoStep" in library[offset : offset + size]


def test_libraries_of_two_processors_lie_side_by_side() -> None:
    made = fat({"x86_64-macos": b"one", "aarch64-macos": b"other"})
    step = 1 << FAT_ALIGNMENT
    assert made[step : step + 3] == b"one"
    assert made[2 * step :] == b"other"


def test_library_for_windows_says_no_time() -> None:
    head = b"MZ" + bytes(58) + struct.pack("<I", 64) + b"PE\0\0" + bytes(4)
    assert timeless(head + b"time" + b"rest") == head + bytes(4) + b"rest"
    assert timeless(b"\x7fELF time") == b"\x7fELF time"


def test_what_decides_the_numbers_is_among_the_options() -> None:
    assert "-ffp-contract=off" in FLAGS
    assert all(binary.targets for binary in PLATFORMS.values())
