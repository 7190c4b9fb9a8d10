"""A kernel built as C by gcc and called through ctypes."""

from __future__ import annotations

import copy
import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense.kernels.emit import C, Graph
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import fields, flat, names

LEVEL = os.environ.get("C_CODE_LEVEL", "-O1")  # as native FMUs are compiled; quick tests: -O0 (tests/conftest.py)
FLAGS = ("-std=c99", LEVEL, "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")
KEPT = Path(__file__).resolve().parents[2] / "build" / "c_code"  # libraries by their source and options

# all samples of a record in one call, or those of a later part of it
RUN = """
void run(int samples, int inputs, int outputs, int is_later, real *state, real *const *memory, const real *given,
    const real *par, const real *const *tables, const int *sizes, real *found)
{
    if (!is_later) %(name)s_initial(state, memory, given, par, tables, sizes, found);
    for (int k = !is_later; k < samples; k++)
        %(name)s_step(state, memory, given + k * inputs, par, tables, sizes, found + k * outputs);
}
"""


def compiled(source: str, folder: Path, options: tuple[str, ...]) -> Path:
    """Shared library of a C source, both in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path, library = folder / "code.c", folder / "code.so"
    path.write_text(source)
    command = ["gcc", *FLAGS, *options, str(path), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return library


def build(source: str, folder: Path, single: bool = False) -> ctypes.CDLL:
    """The library of a kernel, which takes seconds to compile: one that is kept is taken again, by any process."""
    options = ("-DSINGLE", "-Wno-overflow", "-O0") if single else ()  # its bits are not compared
    digest = hashlib.sha256(repr((source, FLAGS, options)).encode()).hexdigest()
    library = KEPT / f"{digest[:32]}.so"
    if not library.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        made = compiled(source, folder, options)
        Path(shutil.copy(made, library.with_suffix(f".{os.getpid()}"))).replace(library)
    return ctypes.CDLL(str(library))


def build_graph(graph: Graph, folder: Path) -> ctypes.CDLL:
    return ctypes.CDLL(str(compiled(C.module(C(graph).source()), folder, ())))


class CKernel:
    """`initial` and `step` of a kernel in C; it keeps its own state and array memory."""

    def __init__(self, kernel: Kernel, folder: Path, single: bool = False) -> None:
        self.kernel, self.real = kernel, np.float32 if single else np.float64
        if "as C" not in vars(kernel):  # beside its cached properties: it is the same in single precision
            vars(kernel)["as C"] = kernel.c() + RUN % {"name": kernel.name}
        self.library = build(vars(kernel)["as C"], folder, single)
        state = fields(kernel.module.State)
        self.memory = [np.zeros(f.size, self.real) for f in state.values() if f.kind == "memory"]
        self.state = self._scalars(kernel.module.State)
        self.outputs = self._scalars(kernel.module.Outputs)
        self.par: tuple[Any, Values] = (None, self._values(()))  # those of the last call, and as arrays
        self.where: tuple[Any, Any] = (None, None)  # array memory of the last call, and its addresses

    def _scalars(self, cls: type) -> np.ndarray:
        arrays = [key for key, f in fields(cls).items() if f.kind in ("memory", "table")]
        return np.zeros(len(names(cls)) - len(arrays), self.real)

    def call(self, function: str, inputs: Any, par: Any) -> None:
        """Call `initial` or `step` in place: the state in is the state out."""
        if par is not self.par[0]:
            self.par = par, self._values(flat(par))
        if self.memory is not self.where[0]:
            self.where = self.memory, _addresses(self.memory)
        given, own = np.array([*inputs], self.real), self.par[1]
        getattr(self.library, f"{self.kernel.name}_{function}")(
            _address(self.state),
            self.where[1],
            _address(given),
            _address(own.scalars),
            own.addresses,
            own.sizes,
            _address(self.outputs),
        )

    def run(self, given: np.ndarray, par: Any, is_later: bool = False) -> np.ndarray:
        """Outputs of all rows of inputs, the first of which is the start unless they are later ones."""
        rows, own = np.ascontiguousarray(given, self.real), self._values(flat(par))
        found = np.empty((len(rows), self.outputs.size), self.real)
        sizes = (ctypes.c_int(size) for size in (*rows.shape, self.outputs.size, is_later))
        self.library.run(
            *sizes,
            _address(self.state),
            _addresses(self.memory),
            _address(rows),
            _address(own.scalars),
            own.addresses,
            own.sizes,
            _address(found),
        )
        return found

    def _values(self, entries: Sequence[Any]) -> Values:
        scalars = np.array([v for v in entries if not isinstance(v, list)], self.real)
        tables = [np.array(v, self.real) for v in entries if isinstance(v, list)]
        sizes = (ctypes.c_int * max(1, len(tables)))(*map(len, tables))
        return Values(scalars, tables, _addresses(tables), sizes)


@cache
def _of_module(module: Any) -> CKernel:
    with tempfile.TemporaryDirectory() as folder:
        return CKernel(Kernel(module), Path(folder))


def fresh(module: Any) -> CKernel:
    """Another instance of a kernel."""
    made = copy.copy(_of_module(module))
    made.memory, made.state, made.outputs = [m.copy() for m in made.memory], made.state.copy(), made.outputs.copy()
    return made


def run(module: Any, rows: Iterable[Sequence[float]] | np.ndarray, par: Any) -> np.ndarray:
    """Outputs of all samples: what `Kernel.run` gives, in a fiftieth of its time."""
    return fresh(module).run(np.array([*rows], float), par)


def driven(plant: Any, par: Any, voltage: np.ndarray, dt: float, *shown: str) -> np.ndarray:
    """Outputs of an actuator at multiples of `dt` [s], one column per name; each voltage [V] is held until the next."""
    return run(plant, _samples(voltage, dt), par)[:, [names(plant.Outputs).index(name) for name in shown]]


def switched(plant: Any, devices: Sequence[Any], which: np.ndarray, voltage: np.ndarray, dt: float, *shown: str) -> Any:
    """As `driven`, with another one of the devices from sample to sample."""
    kernel, rows = fresh(plant), _samples(voltage, dt)
    firsts = [0, *(np.flatnonzero(np.diff(which)) + 1).tolist()]
    found = [kernel.run(rows[a:b], devices[which[a]], a > 0) for a, b in zip(firsts, [*firsts[1:], len(rows)])]
    return np.concatenate(found)[:, [names(plant.Outputs).index(name) for name in shown]]


def _samples(voltage: np.ndarray, dt: float) -> np.ndarray:
    k = np.arange(len(voltage))
    return np.c_[k * dt, np.where(k > 0, dt, 0.0), np.r_[0.0, voltage[:-1]]]


class Values(NamedTuple):
    """Parameters as C takes them."""

    scalars: np.ndarray
    tables: list[np.ndarray]
    addresses: Any  # of the tables
    sizes: Any


def _address(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.__array_interface__["data"][0])  # `ctypes.data` takes twice as long


def _addresses(arrays: list[np.ndarray]) -> Any:
    return (ctypes.c_void_p * max(1, len(arrays)))(*(a.__array_interface__["data"][0] for a in arrays))
