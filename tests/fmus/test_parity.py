"""The shell is thin: an FMU and its kernel called directly give equal bits."""

from __future__ import annotations

import importlib
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from drivers import STEPS, fresh
from parts import FOLDERS, Part, sample_time, tuned

from gapsense.fmi.components import load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.tables import column_name, read_table
from gapsense.kernels.emit.python import namespace
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat, names, record

Function = Callable[..., tuple[Any, Any]]
SHORT = STEPS // 6


def settings(component: Component) -> list[dict[str, Any]]:
    """The defaults, and every option and choice other than the default by itself."""
    found: list[dict[str, Any]] = [{}]
    for port in component.of("parameter"):
        found += [{port.name: choice} for choice in port.choices[1:]]
        found += [{port.name: not port.start}] if port.kind == "Boolean" else []
    return found


SETTINGS = {folder: settings(load_component(folder)) for folder in FOLDERS}


def parameters(part: Part, setting: dict[str, Any], cls: Any) -> Any:
    """The kernel's record."""
    values: dict[str, Any] = {}
    for port in part.component.of("parameter"):
        value = setting.get(port.name, port.start)
        if port.columns:
            columns = [f"{port.field}_{column_name(column)}" for column in port.columns]
            values |= dict(zip(columns, read_table(part.folder / value, port.columns)))
        else:
            values[port.field] = float(port.choices.index(value) if port.choices else value)
    return record(cls, (values[name] for name in names(cls)))


def direct(
    functions: tuple[Function, Function], run: dict[str, Any], period: float, cls: Any, par: tuple[Any, Any], steps: int
) -> list[list[float]]:
    """Outputs of a kernel, its `initial` and `step`, at the start and after each communication step.

    `cls` is its record of inputs, `par` its parameters in the first and in the second half.
    """
    signals = [name for name in cls._fields if name not in ("time", "dt")]

    def inputs(k: int, time: float, dt: float) -> Any:
        values = {"time": time, "dt": dt, **dict(zip(signals, run["inputs"][k]))}
        return cls(**{name: values[name] for name in cls._fields})

    h, (initial, step) = run["step"], functions
    dt = period or h
    state, outputs = initial(inputs(0, 0.0, 0.0), par[0])
    trace = [outputs]
    for k in range(1, steps + 1):
        end = (k - 1) * h + h
        for m in reversed(range(round(h / dt))):
            state, outputs = step(state, inputs(k, end - m * dt, dt), par[k >= STEPS // 2])
        trace.append(outputs)
    return [[float(value) for value in flat(outputs)] for outputs in trace]


@cache
def kernel_of(name: str, path: Path | None) -> Kernel:
    """The kernel with the generated code that is in an FMU, or else with its own, which takes long to make."""
    kernel = Kernel(importlib.import_module(name))
    if path:
        with zipfile.ZipFile(path) as archive:
            (code,) = (member for member in archive.namelist() if member.endswith("/kernel.py"))
            vars(kernel)["scalar"] = namespace(archive.read(code).decode(), kernel.name)
    return kernel


def bits(trace: list[list[float]]) -> list[list[str]]:
    return [[float(value).hex() for value in row] for row in trace]


LONG = ("mhe",)  # whose source takes 0.1 s per step: fewer steps, and options with the slow ones


@pytest.mark.parametrize(
    ("part", "index", "is_whole"),
    [
        pytest.param(
            folder,
            k,
            is_whole,
            id=f"{is_whole}-{folder.name}-{'default' if not s else '='.join(map(str, *s.items()))}",
            marks=[pytest.mark.slow] if is_whole else [],
        )
        for folder, found in SETTINGS.items()
        for k, s in enumerate(found)
        for is_whole in ((True,) if k and folder.name in LONG else (False, True))
    ],
    indirect=["part"],
)
def test_fmu_and_kernel_give_equal_bits(part: Part, fmu: str, index: int, is_whole: bool) -> None:
    """The generated code always to the end, its source so far; that of a long one until it is tuned, with options less.

    In the long tests the code is generated anew; else it is what was packed.
    Options of a source are compared with its generated code in tests/kernels, too, with parameters that are drawn.
    """
    is_long = part.folder.name in LONG
    length = STEPS if is_whole else SHORT // 4 if is_long else SHORT
    if is_long and is_whole:
        length = SHORT if index else STEPS // 2 + SHORT // 4
    module = importlib.import_module(part.component.kernel)
    kernel, period = kernel_of(part.component.kernel, None if is_whole else part.path), sample_time(part.component)
    setting, tuning = SETTINGS[part.folder][index], tuned(part.component)
    par = parameters(part, setting, module.Parameters), parameters(part, setting | tuning, module.Parameters)
    together = [setting] if is_long else SETTINGS[part.folder]
    run = fresh("variants", fmu, together, tuning)[together.index(setting)]
    generated = direct((kernel.initial, kernel.step), run, period, module.Inputs, par, STEPS)
    source = direct((module.initial, module.step), run, period, module.Inputs, par, length)
    assert bits(run["outputs"]) == bits(generated)
    assert run["outputs"][: length + 1] == source  # the sign of a zero may differ
