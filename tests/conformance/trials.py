"""Every FMU in every host that this machine has: its outputs, and those that are right."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from drivers import WINE, fresh
from parts import Part
from unpacked_native import compiled_host, expected, outputs, unpack

Rows = list[list[float]]
ZIG_CC = (sys.executable, "-m", "ziglang", "cc", "-target")
AARCH64 = Path("/usr/aarch64-linux-gnu")
STEPS = 100
COSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
path, step, outputs = sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3])
execution = CosimExecution.from_step_size(step)
slave = execution.add_local_slave(CosimLocalSlave(fmu_path=path, instance_name="one"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
rows = []
for _ in range(int(sys.argv[4])):
    assert execution.step()
    rows.append(list(observer.last_real_values(slave, outputs)))
print(json.dumps(rows))
"""


class Host(NamedTuple):
    """A host and how to try an FMU in it."""

    name: str
    platform: str
    kinds: tuple[str, ...]
    missing: Callable[[], str]  # the tool that this machine lacks, or nothing
    version: Callable[[], str]
    run: Callable[[Part, Path, Path], tuple[Rows, Rows]]  # FMU and a folder to work in: what it gives, what is right


def needs(*programs: str) -> str:
    """The first of these that is missing."""
    return next((program for program in programs if not shutil.which(program)), "")


def in_fmpy(part: Part, path: Path, folder: Path) -> tuple[Rows, Rows]:
    """FMPy, on the inputs of the reference run."""
    with (part.folder / "reference.csv").open(newline="", encoding="utf-8") as file:
        table = [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]
    given = [row[1 : 1 + len(part.component.of("input"))] for row in table]
    return fresh("reference", path, table[1][0], len(table) - 1, given)["outputs"], expected(part)


def in_cosim(part: Part, path: Path, folder: Path) -> tuple[Rows, Rows]:
    """libcosim, with all inputs at their start values, beside FMPy; it counts time in nanoseconds."""
    component = part.component
    refs = json.dumps([k for k, port in enumerate(component.ports) if port.causality == "output"])
    command = [sys.executable, "-c", COSIM, str(path), str(round(1e9 * component.step_size)), refs, str(STEPS)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    starts = [[float(port.start) for port in component.of("input")]] * (STEPS + 1)
    wanted = fresh("reference", path, component.step_size, STEPS, starts)["outputs"][1:]
    rows = next(line for line in done.stdout.splitlines() if line.startswith("[["))  # among messages
    return json.loads(rows), wanted


def made(host: Path, *compiler: str, source: str = "host.c") -> Path:
    """A plain host, compiled once for all components."""
    return host if host.exists() else compiled_host(compiler, host, source=source)


def in_c(part: Part, path: Path, folder: Path) -> tuple[Rows, Rows]:
    """The plain host in C."""
    os.environ["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    host = made(folder.parent / "host", "gcc")
    return outputs([host], unpack(path, folder / "fmu"), part, platform="linux64"), expected(part)


def in_c_of_fmi_3(part: Part, path: Path, folder: Path) -> tuple[Rows, Rows]:
    """The plain host in C for FMI 3.0."""
    host = made(folder.parent / "host", "gcc", source="host3.c")
    return outputs([host], unpack(path, folder / "fmu"), part, platform="x86_64-linux"), expected(part)


def in_wine(part: Part, path: Path, folder: Path) -> tuple[Rows, Rows]:
    """The plain host in C for Windows."""
    os.environ |= WINE
    host = made(folder.parent / "host.exe", *ZIG_CC, "x86_64-windows-gnu")
    return outputs(["wine", host], unpack(path, folder / "fmu"), part, ".dll"), expected(part)


def in_qemu(part: Part, path: Path, folder: Path) -> tuple[Rows, Rows]:
    """The plain host in C for Linux on aarch64."""
    host = made(folder.parent / "host", *ZIG_CC, "aarch64-linux-gnu.2.17")
    return outputs([QEMU, "-L", AARCH64, host], unpack(path, folder / "fmu"), part), expected(part)


def first_line(*command: str) -> str:
    """What a program says of its version."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    return (done.stdout or done.stderr).strip().partition("\n")[0]


QEMU = "qemu-aarch64-static"
BOTH, NATIVE = ("python", "native"), ("native",)
HOSTS: dict[str, Host] = {
    "fmpy": Host("FMPy", "Linux, x86_64", BOTH, lambda: "", lambda: version("fmpy"), in_fmpy),
    "c": Host("plain host in C", "Linux, x86_64", BOTH, lambda: needs("gcc"), lambda: "", in_c),
    "c3": Host("plain host in C", "Linux, x86_64", ("native3",), lambda: needs("gcc"), lambda: "", in_c_of_fmi_3),
    "libcosim": Host(
        "libcosim through libcosimpy",
        "Linux, x86_64",
        BOTH,
        lambda: "" if find_spec("libcosimpy") else "libcosimpy",
        lambda: version("libcosimpy"),
        in_cosim,
    ),
    "wine": Host(
        "plain host in C",
        "Windows, by wine",
        NATIVE,
        lambda: needs("wine"),
        lambda: first_line("wine", "--version").removeprefix("wine-").partition(" ")[0],
        in_wine,
    ),
    "qemu": Host(
        "plain host in C",
        "Linux, aarch64, by qemu",
        NATIVE,
        lambda: needs(QEMU) or ("" if AARCH64.is_dir() else "libc6-arm64-cross"),
        lambda: first_line(QEMU, "--version").removeprefix("qemu-aarch64 version ").partition(" ")[0],
        in_qemu,
    ),
}


def largest_difference(part: Part, found: Rows, wanted: Rows) -> float:
    """Of all outputs, relative to their nominal values."""
    assert len(found) == len(wanted)
    nominal = [port.nominal for port in part.component.of("output")]
    pairs: Any = (zip(a, b, nominal) for a, b in zip(found, wanted))
    return max(abs(x - y) / scale for row in pairs for x, y, scale in row)
