"""Exported components built for a Cortex-M3, M4F or M7, and run under QEMU."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from host import chosen

from gapsense.embedded.code import number
from gapsense.embedded.design import Design
from gapsense.embedded.export import export
from gapsense.embedded.members import members, type_name
from gapsense.kernels.layout import names

HERE = Path(__file__).parent
TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm")
COMMON = ("-std=gnu99", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections", "-mthumb")
LINK = ("-nostartfiles", "--specs=rdimon.specs", "-Wl,--gc-sections")


class Board(NamedTuple):
    """A processor, and the machine of QEMU that has it."""

    machine: str
    flags: tuple[str, ...]


BOARDS = {
    "Cortex-M3": Board("mps2-an385", ("-mcpu=cortex-m3",)),
    "Cortex-M4F": Board("mps2-an386", ("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
}
EVERY = {**BOARDS, "Cortex-M7": Board("mps2-an500", ("-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16"))}


class Cost(NamedTuple):
    """What a component takes on a board, and the largest error and value of every output."""

    mean: float  # instructions per step
    median: float
    most: float
    flash: int  # bytes, with what it needs of the libraries
    memory: int  # bytes of constants, state, inputs and outputs
    stack: int  # bytes
    errors: dict[str, tuple[float, float]]


def missing_tools() -> list[str]:
    """Those that are not installed."""
    return [tool for tool in TOOLS if shutil.which(tool) is None]


def cost(design: Design, rows: Sequence[Sequence[float]], board: str, folder: Path, optimise: str = "-Os") -> Cost:
    """Build a component, let it run over a record of its inputs, and measure."""
    export([design], folder)
    (folder / "data.h").write_text(data(design, rows))
    program = build(design, folder, EVERY[board], optimise, HERE / "measure.c", ("-I", str(folder)))
    lines = [line.split() for line in run(program, EVERY[board]).splitlines()]
    found = {line[0]: float(line[1]) for line in lines if len(line) == 2}
    errors = {line[1]: (float(line[2]), float(line[3])) for line in lines if line[0] == "output"}
    flash = _flash(design, folder, EVERY[board], optimise)
    return Cost(
        mean=found["mean"],
        median=found["median"],
        most=found["most"],
        flash=flash,
        memory=int(found["memory"]),
        stack=int(found["stack"]),
        errors=errors,
    )


def build(
    design: Design, folder: Path, board: Board, optimise: str, main: Path, more: Sequence[str] = ()
) -> Path:  # fmt: skip
    """The program of a main and a component, which is compiled once for each board."""
    program, component = folder / f"{main.stem}.elf", folder / f"{design.name}-{board.machine}.o"
    compiler = ["arm-none-eabi-gcc", *COMMON, optimise, *board.flags]
    if not component.exists():
        _do(*compiler, "-c", folder / f"{design.name}.c", "-o", component)
    files = [folder / "cortex_m" / "start.c", component, main]
    _do(*compiler, *LINK, *more, "-T", folder / "cortex_m" / "link.ld", *files, "-lm", "-o", program)
    return program


def _do(*command: object) -> None:
    subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)


def run(program: Path, board: Board, *, counts: bool = True) -> str:
    """What a program prints; if it counts, every instruction takes 128 ns, three ticks of the timer."""
    command = ["qemu-system-arm", "-M", board.machine, "-nographic", "-semihosting", "-kernel", str(program)]
    command += ["-icount", "shift=7"] if counts else []
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-500:]
    return done.stdout


def _flash(design: Design, folder: Path, board: Board, optimise: str) -> int:
    """Bytes that a program grows by when it calls the component."""
    sizes = []
    for name, called in (("without", ""), ("with", "start(); step();")):
        main = folder / f"{name}.c"
        main.write_text(f'#include "data.h"\nint main(void)\n{{\n    {called}\n    return 0;\n}}\n')
        program = build(design, folder, board, optimise, main, ("-I", str(folder), "-DNO_RECORD"))
        sizes.append(size(program))
    return sizes[1] - sizes[0]


def size(program: Path) -> int:
    """Bytes of code and constants."""
    done = subprocess.run(["arm-none-eabi-size", str(program)], check=True, capture_output=True, text=True)
    text, data = done.stdout.splitlines()[1].split()[:2]
    return int(text) + int(data)


def expected(design: Design, rows: Sequence[Sequence[float]]) -> list[list[float]]:
    """Outputs of the generated Python, in double."""
    code, state, found = design.kernel.scalar, (), []
    par = tuple(design.values[name] for name in names(design.kernel.module.Parameters))
    constants = code["constants"](par)
    for row in rows:
        state, outputs = code["advance"](state, tuple(row), constants) if found else code["initial"](tuple(row), par)
        found.append(chosen(design, outputs))
    return found


def data(design: Design, rows: Sequence[Sequence[float]]) -> str:
    """The header that measure.c includes; `rows` are all inputs of the kernel, in order."""
    found, name = members(design), design.name
    inputs = design.kernel.module.Inputs._fields
    pointers = {f: ", ".join(f"&{n}" for n in (*first, "state", "outputs") if n in found) for f, first in CALLS.items()}
    prepare = f"par = {name}_defaults(); {name}_prepare(&par, &constants); " if "constants" in found else ""
    reads = " ".join(f"inputs.{n} = RECORD[row][{inputs.index(n)}];" for n in design.kept["inputs"])
    outputs = design.kept["outputs"]
    memory = " + ".join(f"sizeof {n}" for n in found if n != "par")
    lines = [
        f'#include "{name}.h"',
        *(f"static {type_name(design, n)} {n};" for n in found),
        f"static inline void start(void) {{ {prepare}{name}_initial({pointers['initial']}); }}",
        f"static inline void step(void) {{ {name}_step({pointers['step']}); }}",
        "#ifndef NO_RECORD",
        f"enum {{ ROWS = {len(rows)}, OUTPUTS = {len(outputs)} }};",
        f"#define MEMORY ({memory})",
        f"static const char *const NAMES[] = {{{', '.join(f'{chr(34)}{n}{chr(34)}' for n in outputs)}}};",
        _matrix(design.real, "RECORD", rows, design.real),
        _matrix("double", "EXPECTED", expected(design, rows), "double"),
        f"static void read_row(int row) {{ {reads} }}",
        "static double output(int k) { return (double)*((" + design.real + " *)&outputs + k); }",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


CALLS = {"initial": ("inputs", "par"), "step": ("inputs", "constants")}


def _matrix(kind: str, name: str, rows: Sequence[Sequence[float]], real: str) -> str:
    lines = ",\n".join("{" + ", ".join(number(v, real) for v in row) + "}" for row in rows)
    return f"static const {kind} {name}[{len(rows)}][{len(rows[0])}] = {{\n{lines}}};"
