"""The FMUs' own time: the raw set, step and get calls from a loop in C, so that nothing else is in it."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from experiment import WATCHED, Experiment, common, component_steps, real_rates

from gapsense.cosim.fmu.instance import GET, SET, STEP
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.part import Channel, Part

FLAGS = ("-std=c99", "-O2", "-Wall", "-shared", "-fPIC")
Outcome = tuple[float, int, dict[str, float]]
Rows = npt.NDArray[np.float64]
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
    set_, step, get = (ctypes.cast(part.instance.function(name), POINTER).value for name in (SET, STEP, GET))
    links = (INT * (2 * len(part.wires)))(*(place for wire in part.wires for place in wire[:2]))
    kept.append(links)
    (takes, n_in, given), (gives, n_out, got) = (doubles(channels) for channels in (part.givers, part.readers))
    return CPart(
        part.instance.pointer, set_, step, get, takes, gives, n_in, n_out, given, got,
        ctypes.addressof(links), len(part.wires), part.component.step, part.component.offset,
    )  # fmt: skip


def doubles(channels: Sequence[Channel]) -> tuple[int, int, int]:
    """Address of the references, number and address of the values; the signals of our components are doubles."""
    if not channels:
        return 0, 0, 0
    (one,) = channels
    return ctypes.addressof(one.references), len(one.values), ctypes.addressof(one.values)


def run(experiment: Experiment) -> Outcome:
    """Seconds of the loop, component-steps, last outputs."""
    kept: list[Any] = []
    with Master(*experiment) as master:
        master.initialize(experiment[0].seeds, {})
        grid = experiment[0].experiment
        parts = (CPart * len(master.parts))(*(c_part(part, kept) for part in master.parts))
        buffer = ctypes.c_void_p(master.view.ctypes.data)
        start, base = ctypes.c_double(grid.start), ctypes.c_double(grid.base_step)
        seconds = library().run(parts, INT(len(parts)), buffer, start, base, ctypes.c_long(grid.count))
        if seconds < 0.0:
            raise RuntimeError("a component failed in the loop in C.")
        last = {str(port): master.buffer[master.places.index[port]] for port in WATCHED}
    return seconds, component_steps(experiment), last


def own_time(fmus: Path) -> Outcome:
    """Of the common experiment."""
    return run(common(fmus))


def own_time_real_rates(fmus: Path) -> Outcome:
    """Of the scenario as it is."""
    return run(real_rates(fmus))


class Replayed(NamedTuple):
    """Seconds of one component on recorded inputs."""

    total: list[float]  # of all set, do_step and get calls
    steps: Rows  # of each do_step


def replay(experiment: Experiment, rows: Rows) -> dict[str, Replayed]:
    """Each component by itself, one after the other; a column of `rows` for each signal of the experiment."""
    c, grid, found = library(), experiment[0].experiment, {}
    with Master(*experiment) as master:
        master.initialize(experiment[0].seeds, {})
        for part in master.parts:
            part.wires.clear()
            one, steps = c_part(part, []), np.empty(len(rows))
            places = [master.places.index[p] for p in master.places.of(part.component.name, "input")]
            given = np.ascontiguousarray(rows[:, places])
            times, count = map(ctypes.c_double, (grid.start, grid.base_step)), ctypes.c_long(len(given))
            pointers = (given, steps)
            rows_in, steps_out = (ctypes.c_void_p(array.ctypes.data) for array in pointers)
            if c.replay(ctypes.byref(one), rows_in, *times, count, steps_out):
                raise RuntimeError(f"`{part.component.name}` failed in the loop in C.")
            found[part.component.name] = Replayed(list(one.seconds), steps)
    return found
