"""The model of `Mhe` compiled, and the kernel in C run on records."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from c_code import CKernel, fresh

from gapsense.estimators.mhe import mhe
from gapsense.estimators.mhe.model import (
    Device,
    Model,
    Point,
    advance,
    apply_corrections,
    current,
    device,
    mean_of,
    model,
    point,
)
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import Scalar, fields, flat, names, record
from gapsense.scenarios.estimators.parameters import VALVE, Valve, reduced

KERNEL = Kernel(mhe)
T_S, START = 20e-6, 11  # sampling period; correction of the flux linkage at the start


class Level(NamedTuple):
    voltage: Scalar


Told = NamedTuple("Told", [*((name, Scalar) for name in Point._fields), ("current", Scalar)])  # type: ignore[misc]


class Run(NamedTuple):
    """The model on a record."""

    points: np.ndarray  # (n, 10), rows are a `Point`
    current: np.ndarray


def blind(valve: Valve = VALVE, **changes: Any) -> mhe.Parameters:
    """What `Ekf` is told; the defaults for the core losses."""
    par: mhe.Parameters = kernel_parameters(own("mhe"), reduced(valve))
    return par._replace(**changes)


@cache
def _model() -> CKernel:
    """`advance` and the current of the new point, compiled."""

    def initial(inputs: Level, par: Model) -> tuple[Point, Told]:
        start = Point(*(0.0 for _ in Point._fields))
        return start, Told(*start, inputs.voltage)

    def step(state: Point, inputs: Level, par: Model) -> tuple[Point, Told]:
        new = advance(state, inputs.voltage, par)
        return new, Told(*new, current(new, mean_of(state.voltage, inputs.voltage, par), par))

    records = {"Parameters": Model, "State": Point, "Inputs": Level, "Outputs": Told}
    module = SimpleNamespace(__name__="model_of_mhe", **records, initial=initial, step=step)
    with tempfile.TemporaryDirectory() as folder:
        return CKernel(Kernel(module), Path(folder))  # type: ignore[arg-type]


def model_run(start: Point, voltage: Iterable[float], m: Model) -> Run:
    """The model on the voltages after the start."""
    c = _model()
    c.state[:] = flat(start)
    found = c.run(np.array([*voltage], float)[:, None], m, is_later=True)
    return Run(np.vstack([flat(start), found[:, :-1]]), np.r_[float(current(start, 0.0, m)), found[:, -1]])


def at_rest(m: Model, lam: float = 0.0) -> Point:
    """On the upper stop without voltage."""
    return point(lam, 0.0, m.upper, 0.0, 0.0, m)


def corrected_run(par: mhe.Parameters, q: np.ndarray, voltage: np.ndarray) -> Run:
    """The model with corrections q (12,) from rest on."""
    m = model(par, apply_corrections(device(par), q[:START]))
    return model_run(at_rest(m, q[START]), voltage[1:].tolist(), m)


def true_device(par: mhe.Parameters) -> Device:
    """Another one than `par` says: all that is learnt is wrong by a deviation of the blind prior or less."""
    factors = Device(1.1, 1.6, 0.98, 1.3, 1.03, 0.6, 1.03, 0.98, 1.0, 1.0, 1.0)
    return Device(*(f * value for f, value in zip(factors, device(par))))


def kernel() -> CKernel:
    """Another instance of the kernel in C."""
    return fresh(mhe)


def state_of(c: CKernel) -> mhe.State:
    """The state as it is, copied."""
    scalars, memory, entries = iter(c.state.tolist()), iter(c.memory), []
    for f in fields(mhe.State).values():
        entries += [next(memory).copy()] if f.kind == "memory" else [next(scalars) for _ in range(f.size)]
    found: mhe.State = record(mhe.State, entries)
    return found


def entry_of(c: CKernel, name: str) -> float:
    """One number of the state."""
    return float(c.state[_place(name)])


@cache
def _place(name: str) -> int:
    """Among the numbers of the state without its array memory."""
    kinds = {field: at.kind for field, at in fields(mhe.State).items()}
    return [entry for entry in names(mhe.State) if kinds.get(entry) != "memory"].index(name)


def rows(voltage: np.ndarray, current: np.ndarray, command: np.ndarray | None = None, dt: float = T_S) -> np.ndarray:
    """Inputs of all samples."""
    n = voltage.size
    return np.c_[np.arange(n) * dt, voltage, current, np.zeros(n) if command is None else command]


def run(par: mhe.Parameters, given: np.ndarray, seen: Callable[[CKernel], Any] | None = None) -> dict[str, np.ndarray]:
    """Outputs of all samples by name; `seen` is called with the kernel before each step."""
    c = kernel()
    found = _watched(c, par, given, seen) if seen else c.run(given, par)
    return dict(zip(names(mhe.Outputs), found.T))


def _watched(c: CKernel, par: mhe.Parameters, given: np.ndarray, seen: Callable[[CKernel], Any]) -> np.ndarray:
    found = []
    for k, row in enumerate(given):
        if k:
            seen(c)
        c.call("step" if k else "initial", row, par)
        found.append(c.outputs.copy())
    return np.array(found)
