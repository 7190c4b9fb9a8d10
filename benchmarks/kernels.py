"""What a step of each kernel costs in each of its forms: `python benchmarks/kernels.py [NAME ...]`.

Source on floats, generated Python, C over many runs (per run), C in double and in float. The kernels are
found, and their parameters and inputs drawn, as in tests/kernels/test_parity.py. Of the generated Python also what a
busy machine does not change: how many instructions of the interpreter a step takes.
"""

from __future__ import annotations

import argparse
import ctypes
import random
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from types import FrameType, SimpleNamespace
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "kernels"))
from c_code import CKernel
from kernel_cases import input_sequence, kernel, kernel_modules, parameters

from gapsense.kernels.lanes import step_runs
from gapsense.kernels.layout import flat

STEPS, DRAWN = 200, 50  # steps of a sequence; different runs in a batch, which is filled with copies of them
MANY, STEPS_OVER_RUNS = 1000, 20
ENOUGH = 0.3  # seconds of measuring each form
LOOP = """
#include <time.h>

/* Nanoseconds per step of `repeats` sequences of `count` steps, each from the same state. */
double nanoseconds(int repeats, int count, int width, int states, const real *start, real *state, real *const *memory,
    const real *inputs, const real *par, const real *const *tables, const int *sizes, real *outputs)
{
    struct timespec a, b;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (int r = 0; r < repeats; r++) {
        for (int i = 0; i < states; i++) state[i] = start[i];
        for (int k = 0; k < count; k++)
            NAME_step(state, memory, inputs + k * width, par, tables, sizes, outputs);
    }
    clock_gettime(CLOCK_MONOTONIC, &b);
    return (1e9 * (b.tv_sec - a.tv_sec) + (b.tv_nsec - a.tv_nsec)) / ((double)repeats * count);
}
"""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="kernels, all by default")
    wanted = parser.parse_args().names
    titles = ["kernel", "source", "Python", "instructions", f"C, {MANY} runs", "C double", "C float"]
    table = Table(title="Microseconds per step and run: the best of several sequences")
    for title in titles:
        table.add_column(title, justify="left" if title == "kernel" else "right")
    for module in kernel_modules():
        if not wanted or kernel(module).name in wanted:
            table.add_row(kernel(module).name, *(f"{value:.4g}" for value in row(module)))
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def row(module: str) -> list[float]:
    """Microseconds per step of one kernel, form by form."""
    k, rng = kernel(module), random.Random(1)
    par, inputs = parameters(module, rng), list(input_sequence(module, rng, STEPS + 1, degenerate=False))
    source = best(lambda: sequence(k.module.initial, k.module.step, inputs, par), STEPS)
    entries, values = tuple(flat(par)), [flat(given) for given in inputs]
    constants, advance = k.scalar["constants"](entries), k.scalar["advance"]
    python = best(
        lambda: sequence(lambda given, _: k.scalar["initial"](given, entries), advance, values, constants), STEPS
    )
    count = instructions(advance, k.scalar["initial"](values[0], entries)[0], values[1:], constants)
    return [source, python, count, over_runs(module, MANY), in_c(module, False), in_c(module, True)]


def sequence(initial: Callable[..., Any], step: Callable[..., Any], inputs: Sequence[Any], par: Any) -> float:
    """Seconds of all steps."""
    state, _ = initial(inputs[0], par)
    begin = perf_counter()
    for given in inputs[1:]:
        state, _ = step(state, given, par)
    return perf_counter() - begin


def instructions(advance: Callable[..., Any], state: Any, inputs: Sequence[Any], constants: Any) -> float:
    """Instructions of the interpreter in a step."""
    count = 0

    def traced(frame: FrameType, event: str, _: Any) -> Any:
        """Count an instruction."""
        nonlocal count
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        count += event == "opcode"
        return traced

    sys.settrace(traced)
    try:
        for given in inputs:
            state, _ = advance(state, given, constants)
    finally:
        sys.settrace(None)
    return count / len(inputs)


def best(measured: Callable[[], float], steps: int) -> float:
    """Microseconds per step of the fastest sequence."""
    end, found = perf_counter() + ENOUGH, [measured()]
    while perf_counter() < end:
        found.append(measured())
    return 1e6 * min(found) / steps


def over_runs(module: str, runs: int) -> float:
    """Microseconds per step and run of C over runs, with what it takes to hand the numbers over."""
    par, inputs = drawn(module, runs)

    def seconds() -> float:
        """How long one call takes."""
        begin = perf_counter()
        step_runs(kernel(module), inputs, par)
        return perf_counter() - begin

    inputs = np.array(inputs)
    seconds()  # compiles
    return best(seconds, STEPS_OVER_RUNS * runs)


def drawn(module: str, runs: int) -> tuple[list[Any], list[list[Any]]]:
    """Parameters and inputs of runs that differ."""
    rngs = [random.Random(100 + run) for run in range(DRAWN)]
    pars = [parameters(module, rng) for rng in rngs]
    rows = zip(*(input_sequence(module, rng, STEPS_OVER_RUNS + 1, degenerate=False) for rng in rngs))

    def filled(values: Sequence[Any]) -> Any:
        return values[0] if isinstance(values[0], list) else np.resize(np.array(values, float), runs)

    par = [filled(entry) for entry in zip(*map(flat, pars))]
    return par, [[filled(entry) for entry in zip(*map(flat, given))] for given in rows]


def in_c(module: str, single: bool) -> float:
    """Microseconds per step in C (gcc -O2 -ffp-contract=off), called from a loop in C."""
    k, rng = kernel(module), random.Random(1)
    par, inputs = parameters(module, rng), list(input_sequence(module, rng, STEPS + 1, degenerate=False))
    source = "#define _POSIX_C_SOURCE 199309L\n" + k.c() + LOOP.replace("NAME", k.name)
    with tempfile.TemporaryDirectory() as folder:
        c = CKernel(SimpleNamespace(name=k.name, module=k.module, c=lambda: source), Path(folder), single)
    c.call("initial", inputs[0], par)
    tables = [np.array(v, c.real) for v in flat(par) if isinstance(v, list)]
    sizes = (ctypes.c_int * max(1, len(tables)))(*map(len, tables))
    given = np.array([flat(i) for i in inputs[1:]], c.real)
    scalars, start = np.array([v for v in flat(par) if not isinstance(v, list)], c.real), c.state.copy()
    states = [given.shape[1], len(start), address(start), address(c.state), addresses(c.memory)]
    rest = [address(given), address(scalars), addresses(tables), sizes, address(c.outputs)]
    function = c.library.nanoseconds
    function.restype = ctypes.c_double
    repeats = max(1, round(1e9 * ENOUGH / 5 / STEPS / max(1.0, function(1, STEPS, *states, *rest))))
    return min(float(function(repeats, STEPS, *states, *rest)) for _ in range(5)) / 1e3


def address(array: Any) -> ctypes.c_void_p:
    """Where an array's numbers are."""
    return ctypes.c_void_p(array.ctypes.data)


def addresses(arrays: Sequence[Any]) -> Any:
    """The same for several arrays."""
    return (ctypes.c_void_p * max(1, len(arrays)))(*(a.ctypes.data for a in arrays))


if __name__ == "__main__":
    main()
