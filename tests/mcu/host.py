"""Exported components built and run on this machine, and what the Python kernel gives in their place."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gapsense.embedded.design import Design
from gapsense.embedded.export import export, record, sample_time, signals
from gapsense.kernels.layout import names

ROOT = Path(__file__).resolve().parents[2]
FLAGS = ("-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow")


def played(design: Design, folder: Path, *flags: str) -> list[list[float]]:
    """Export a component, build its example, run it: the rows that it prints."""
    export([design], folder)
    program = folder / design.name
    files = [str(folder / f"{design.name}{ending}.c") for ending in ("", "_main")]
    compile_("gcc", "-std=c99", "-O0", *flags, *files, "-lm", "-o", str(program))
    text = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    return read(design, text)


def read(design: Design, printed: str) -> list[list[float]]:
    """The rows that an example has printed."""
    titles, *rows = printed.splitlines()
    assert titles.split(",") == [*design.kept["outputs"]]
    return [[float(cell) for cell in row.split(",")] for row in rows]


def compile_(*command: str) -> None:
    """Run a compiler that must find nothing to say."""
    done = subprocess.run([command[0], *FLAGS, "-Werror", *command[1:]], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def shorten(main: Path, rows: int) -> None:
    """Let an example end after so many rows: one that is compared over its first rows need not play all."""
    head, loop, tail = main.read_text(encoding="utf-8").partition("row < ROWS;")
    assert loop
    main.write_text(f"{head}row < {rows};{tail}", encoding="utf-8")


def expected(design: Design, most: int = 6_000) -> list[list[float]]:
    """What the example must print, by the generated Python; no more rows than take so many steps."""
    module, code = design.kernel.module, design.kernel.scalar
    par = tuple(design.values[name] for name in names(module.Parameters))
    constants, cls = code["constants"](par), module.Inputs
    times, rows = record(design)
    period = sample_time(design) or times[1]
    steps = max(1, round(times[1] / period))
    state: Any = None
    found = []
    for k, row in enumerate(rows[: 1 + most // steps]):
        given = {"dt": period if k else 0.0, **dict(zip(signals(design), row))}
        for n in range(steps if k else 1):
            given["time"] = period * ((k - 1) * steps + n + 1) if k else 0.0
            inputs = tuple(given.get(name, 0.0) for name in cls._fields)
            state, outputs = code["advance"](state, inputs, constants) if k else code["initial"](inputs, par)
        found.append(chosen(design, outputs))
    return found


def chosen(design: Design, outputs: Sequence[float]) -> list[float]:
    """The outputs of a design among the flat ones of its kernel."""
    values = dict(zip(names(design.kernel.module.Outputs), outputs))
    return [float(values[name]) for name in design.kept["outputs"]]
