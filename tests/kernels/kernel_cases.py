"""Every kernel of the project, with parameters and inputs to run it on, found without a list.

Parameters come from the port table of the component that is made from the kernel, `fmus/<component>/component.py`; a
kernel without a component needs an entry in `EXAMPLES`.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gapsense.fmi.tables import column_name, read_table
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import fields, leaves, names, record, triangle

PACKAGES = ("gapsense.actuators", "gapsense.control", "gapsense.estimators", "gapsense.drive", "gapsense.sensor")
CONTRACT = ("Parameters", "State", "Inputs", "Outputs", "initial", "step")
FMUS = Path(__file__).parents[2] / "fmus"

# kernel module -> (parameters by field, nominal inputs by field, step in s); only for kernels without a component
EXAMPLES: dict[str, tuple[dict[str, Any], dict[str, float], float]] = {}

# what parameters are that switch something on, by field; their default is 0
OPTIONAL = {"core_bend": 8e6, "core_eddy": 1e-3, "core_hysteresis": 10e-3}


def kernel_modules() -> list[str]:
    """Names of the modules that define a kernel."""
    found = []
    for package in PACKAGES:
        folder = importlib.import_module(package).__path__
        for info in pkgutil.walk_packages(folder, f"{package}."):
            module = importlib.import_module(info.name)
            if all(hasattr(module, name) for name in CONTRACT):
                found.append(info.name)
    return found


@cache
def kernel(name: str) -> Kernel:
    return Kernel(importlib.import_module(name))


@cache
def components() -> dict[str, tuple[Any, Path]]:
    """Port table and folder of the component made from each kernel module."""
    found = {}
    for file in sorted(FMUS.glob("*/component.py")):
        spec = importlib.util.spec_from_file_location(f"component_{file.parent.name}", file)
        assert spec and spec.loader
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        found.setdefault(module.COMPONENT.kernel, (module.COMPONENT, file.parent))
    lean = {f"{name}_lean": made for name, made in found.items()}
    return found | {name: lean[name] for name in kernel_modules() if name in lean}


def _draw(port: Any, rng: random.Random, folder: Path) -> Iterator[tuple[str, Any]]:
    """Kernel fields that a parameter sets."""
    if port.columns:
        columns = read_table(folder / port.start, port.columns)
        for name, values in zip(port.columns, columns):
            yield f"{port.field}_{column_name(name)}", values
    elif port.choices:
        yield port.field, float(rng.randrange(len(port.choices)))
    elif port.kind == "Boolean":
        yield port.field, float(rng.random() < 0.5)
    elif port.kind == "Integer":
        yield port.field, float(rng.randrange(1, 1000))
    else:
        usual = port.start or rng.choice((0.0, OPTIONAL.get(port.field, 0.0)))
        yield port.field, usual * rng.uniform(0.9, 1.1)


def parameters(name: str, rng: random.Random) -> Any:
    """Plausible parameters, drawn around the defaults."""
    cls = kernel(name).module.Parameters
    if name in components():
        component, folder = components()[name]
        drawn = dict(item for port in component.of("parameter") for item in _draw(port, rng, folder))
    elif name in EXAMPLES:
        drawn = {
            key: value * rng.uniform(0.9, 1.1) if isinstance(value, float) else value
            for key, value in EXAMPLES[name][0].items()
        }
    else:
        raise AssertionError(
            f"`{name}` has no component in fmus/. Give it an example in EXAMPLES of {Path(__file__).name}."
        )
    expected = names(cls)
    assert set(drawn) == set(expected), f"{name}: ports and Parameters differ in {set(drawn) ^ set(expected)}"
    return record(cls, (drawn[entry] for entry in expected))


def nominal_inputs(name: str) -> tuple[dict[str, float], float]:
    """Nominal value of each input, and the step."""
    if name in components():
        component, _ = components()[name]
        return {port.field: port.nominal for port in component.of("input")}, component.step_size
    return EXAMPLES[name][1], EXAMPLES[name][2]


def input_sequence(name: str, rng: random.Random, count: int, degenerate: bool = True) -> Iterator[Any]:
    """Random inputs, held for some steps; now and then zeros, tiny, huge and negative ones."""
    cls = kernel(name).module.Inputs
    nominal, dt = nominal_inputs(name)
    held = {key: 0.0 for key in nominal}
    for k in range(count):
        for key, value in nominal.items():
            if rng.random() < 0.3:
                held[key] = value * rng.choice((0.0, 1.0, 1.0, rng.uniform(-1.5, 1.5)))
            if degenerate and rng.random() < 0.05:
                held[key] = value * rng.choice((-1.0, 1e-300, -1e-12, 1e4, -1e3, 1e9))
        clock = {"time": k * dt, "dt": dt if k else 0.0}
        yield cls(**{key: held[key] if key in held else clock[key] for key in cls._fields})


def disturbed(state: Any, rng: random.Random) -> Any:
    """The state with its estimate or its covariance made degenerate: zero, tiny or huge."""
    entries: list[Any] = []
    for _, field, value in leaves(state):
        if field.kind in ("vector", "covariance") and rng.random() < 0.5:
            value = value * rng.choice((0.0, 1e-150, 1e-8, 1e8))
        if field.kind == "covariance":
            entries += [value[i, j] for i, j in triangle(field.size)]
        else:
            entries += [*value] if field.kind == "vector" else [value]
    return record(type(state), entries)


def is_estimator(name: str) -> bool:
    return ".estimators." in name


def covariance_diagonal(name: str) -> list[int]:
    """Places of the variances among the flat entries of the state."""
    places, start = [], 0
    for field in fields(kernel(name).module.State).values():
        if field.kind == "covariance":
            rows = np.cumsum([0, *range(field.size, 1, -1)])
            places += [start + int(row) for row in rows]
        start += {"vector": field.size, "covariance": field.size * (field.size + 1) // 2}.get(field.kind, 1)
    return places
