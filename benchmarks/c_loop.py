"""The FMUs' own time: the raw set, step and get calls from a loop in C, so that nothing else is in it."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from experiment import WATCHED, Experiment, common, component_steps, real_rates

from gapsense.cosim.master import Master
from gapsense.cosim.part import GET, SET, STEP, Part

POINTER, INT, SIZE = ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t


class CPart(ctypes.Structure):
    """`Part` of c_loop.c."""

    _fields_ = [
        ("instance", POINTER), ("set", POINTER), ("step", POINTER), ("get", POINTER),
        ("inputs", POINTER), ("outputs", POINTER), ("input_count", SIZE), ("output_count", SIZE),
        ("input_values", POINTER), ("output_values", POINTER),
        ("links", POINTER), ("link_count", INT), ("every", INT), ("offset", INT), ("seconds", ctypes.c_double * 3),
    ]  # fmt: skip


def library() -> ctypes.CDLL:
    """c_loop.c, compiled."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "c_loop.so")
        source = Path(__file__).with_suffix(".c")
        subprocess.run(
            ["gcc", "-std=c99", "-O2", "-Wall", "-shared", "-fPIC", str(source), "-o", str(path)], check=True
        )
        loaded = ctypes.CDLL(str(path))
    loaded.run.restype = ctypes.c_double
    return loaded


def c_part(part: Part, kept: list[Any]) -> CPart:
    """A part of our master as C takes it; `kept` keeps alive what is pointed to."""

    def address(function: str) -> int | None:
        return ctypes.cast(part.instance.function(function), POINTER).value  # type: ignore[arg-type]

    links = (INT * (2 * len(part.plain)))(*(place for pair in part.plain for place in pair))
    kept.append(links)
    given, got = part.set_inputs, part.get_outputs
    return CPart(
        part.instance.pointer, address(SET), address(STEP), address(GET),
        ctypes.addressof(given.references), ctypes.addressof(got.references), len(given.values), len(got.values),
        ctypes.addressof(given.values), ctypes.addressof(got.values),
        ctypes.addressof(links), len(part.plain), part.component.step, part.component.offset,
    )  # fmt: skip


def run(experiment: Experiment, is_timed: bool) -> tuple[float, dict[str, list[float]], dict[str, float]]:
    """Seconds of the loop, seconds of set, step and get by component, last outputs."""
    c, kept = library(), []
    with Master(*experiment) as master:
        master.initialize(experiment[0].seeds)
        grid = experiment[0].experiment
        parts = (CPart * len(master.parts))(*(c_part(part, kept) for part in master.parts))
        buffer = ctypes.c_void_p(master.view.ctypes.data)
        start, base = ctypes.c_double(grid.start), ctypes.c_double(grid.base_step)
        seconds = c.run(parts, INT(len(parts)), buffer, start, base, ctypes.c_long(grid.count), INT(is_timed))
        if seconds < 0.0:
            raise RuntimeError("a component failed in the loop in C.")
        last = {str(port): master.buffer[master.places.index[port]] for port in WATCHED}
        shares = {part.component.name: list(p.seconds) for part, p in zip(master.parts, parts)}
    return seconds, shares, last


def own_time(fmus: Path) -> tuple[float, int, dict[str, float]]:
    """Of the common experiment."""
    experiment = common(fmus)
    seconds, _, last = run(experiment, False)
    return seconds, component_steps(experiment), last


def own_time_real_rates(fmus: Path) -> tuple[float, int, dict[str, float]]:
    """Of the scenario as it is."""
    experiment = real_rates(fmus)
    seconds, _, last = run(experiment, False)
    return seconds, component_steps(experiment), last
