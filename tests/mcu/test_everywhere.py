"""Components as C in double give the bits of the Python kernel on every processor, with every way of optimising."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from board import BOARDS, build, missing_tools, run
from drivers import WINE
from host import expected, read, shorten
from test_export import FOLDERS

from gapsense._os.native import zig_version
from gapsense.embedded.design import make_design
from gapsense.embedded.export import export

# -s, as the hosts of tests/native have it, which share the C library that Zig makes
ZIG = (sys.executable, "-m", "ziglang", "cc", "-std=c99", "-ffp-contract=off", "-s", "-target")
HERE = Path(__file__).parent
# Its library is there. Zig makes its own of Linux first, in a minute.
NEWLIB = ("arm-none-eabi-gcc", "-mcpu=cortex-a9", "-mfpu=vfpv3", "-mfloat-abi=hard", "--specs=rdimon.specs")


class Machine(NamedTuple):
    """How a program for another machine is compiled, and run here."""

    compiler: tuple[str, ...]
    runner: tuple[str, ...]
    linker: tuple[str, ...] = ()  # what compiles the example and links, if it is another


MACHINES = {  # clang takes twice the time with -O2: once is enough
    "arm32": Machine((*ZIG, "arm-linux-gnueabihf", "-O2"), ("qemu-arm-static",), NEWLIB),
    "wasm32": Machine((*ZIG, "wasm32-wasi", "-O1"), ("node", "--no-warnings", str(HERE / "wasi.mjs"))),
    "windows": Machine((*ZIG, "x86_64-windows-gnu", "-O1"), ("wine",)),
    "x86 with FMA": Machine(("gcc", "-std=c99", "-ffp-contract=off", "-O3", "-march=haswell", "-static"), ()),
}
WHOLE = "Cortex-M4F"  # of the boards, the one on which all components run
LARGE = (
    *("bounded_ukf", "ertss", "mhe", "play_actuator", "power_stage", "reluctance_actuator", "run_to_run"),
    "table_actuator",
)
STEPS = dict.fromkeys(("bounded_ukf", "ertss", "mhe"), 3_000)  # which take all branches that 6,000 take, by gcov
CASES = [
    case
    for case in itertools.product(MACHINES, FOLDERS)
    if case[0] != "wasm32" or case[1] not in LARGE  # their FMUs run there, in tests/native/test_wasm.py
]


@cache
def wanted(name: str) -> list[list[float]]:
    """What every machine must print."""
    return expected(make_design(FOLDERS[name], "double"), STEPS.get(name, 6_000))


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "name"), CASES)
def test_double_has_the_same_bits_on_other_machines(machine: str, name: str, tmp_path: Path) -> None:
    compiler, runner, linker = MACHINES[machine]
    if missing := [tool for tool in (*runner[:1], *linker[:1]) if not shutil.which(tool)]:
        pytest.skip(f"no {' and no '.join(missing)}, which make and run programs for {machine}")
    if compiler[0] == sys.executable and not zig_version():
        pytest.skip("no ziglang, which compiles for other machines")
    design = make_design(FOLDERS[name], "double")
    export([design], tmp_path)
    program, code, main = (str(tmp_path / f"{design.name}{ending}") for ending in (".exe", ".o", "_main.c"))
    shorten(Path(main), len(wanted(name)))
    subprocess.run([*compiler, "-c", str(tmp_path / f"{design.name}.c"), "-o", code], check=True, capture_output=True)
    subprocess.run([*(linker or compiler), main, code, "-lm", "-o", program], check=True, capture_output=True)
    done = subprocess.run([*runner, program], check=True, capture_output=True, text=True, env={**os.environ, **WINE})
    assert np.array_equal(read(design, done.stdout), wanted(name), equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "board"), [(name, board) for name in FOLDERS for board in BOARDS if board == WHOLE or name not in LARGE]
)
def test_double_has_the_same_bits_on_microcontrollers(name: str, board: str, tmp_path: Path) -> None:
    """Neither processor has instructions for double: what takes long to compile is for one of them."""
    if missing := missing_tools():
        pytest.skip(f"no {' and no '.join(missing)}")
    design = make_design(FOLDERS[name], "double")
    export([design], tmp_path)
    main = tmp_path / f"{design.name}_main.c"
    shorten(main, len(wanted(name)))
    program = build(design, tmp_path, BOARDS[board], "-Os", main)
    assert np.array_equal(read(design, run(program, BOARDS[board], counts=False)), wanted(name), equal_nan=True)
