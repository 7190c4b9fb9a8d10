"""Kernels over runs: each run with inputs, parameters and a state of its own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from gapsense.kernels.emit import HARMLESS_IN_C, Lanes, split
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes.code import Code
from gapsense.kernels.lanes.plan import Array, Floats, Plan, plan
from gapsense.kernels.layout import fields, names

INPUTS = "inputs of all samples"  # the column, called as no parameter is


class OverRuns(NamedTuple):
    """The functions of a kernel, for a plan: `step(state, inputs, par)` is `advance(state, inputs, constants(par))`."""

    initial: Code  # (inputs, par): state and outputs
    constants: Code  # (par)
    advance: Code  # (state, inputs, constants): state and outputs


@cache
def over_runs(kernel: Kernel) -> OverRuns:
    """The functions of a kernel over runs."""
    initial, step = kernel.graphs
    constants, advance = split(step, Lanes, HARMLESS_IN_C)
    return OverRuns(Code(initial), Code(constants), Code(advance))


def stepped(kernel: Kernel, inputs: Any, par: Sequence[Any], outputs: Sequence[str] = ()) -> Floats:
    """Outputs of many runs of a kernel, (samples, outputs, runs).

    Parameters
    ----------
    kernel : Kernel
        Which; the first sample is that of `initial`, all others are steps.
    inputs : array
        Flat inputs of each sample, (samples, inputs, runs), or (samples, inputs, 1) if all runs have the same.
    par : sequence
        Flat parameters: arrays (runs,) or numbers for all runs; tables are lists, or arrays (numbers, runs).
    outputs : sequence of str
        Names of the flat outputs that are wanted, all of them by default.
    """
    columns = {
        name: value if kind is Array.TABLE else np.reshape(value, (1, -1))
        for (name, kind), value in zip(columns_of(kernel).items(), par)
    }
    samples, width, count = np.shape(inputs)
    columns[INPUTS] = np.reshape(inputs, (samples * width, count))
    runs = max(np.shape(value)[1] for value in columns.values() if np.ndim(value) == 2)
    return plan_of(kernel, samples, (*outputs,)).run(runs, **columns).reshape(samples, -1, runs)


def is_compiled(kernel: Kernel, samples: int, outputs: Sequence[str] = ()) -> bool:
    """Whether `stepped` has C for this; without it `Kernel.run` is faster."""
    return plan_of(kernel, samples, (*outputs,)).library is not None


def columns_of(kernel: Kernel) -> dict[str, int | Array]:
    """A column for each flat parameter."""
    cls = kernel.module.Parameters
    tables = [name for name, field in fields(cls).items() if field.kind == "table"]
    return {name: Array.TABLE if name in tables else 1 for name in names(cls)}


@cache
def plan_of(kernel: Kernel, samples: int, outputs: tuple[str, ...]) -> Plan:
    """The plan of some samples, for `stepped`."""
    width, every = len(names(kernel.module.Inputs)), names(kernel.module.Outputs)
    chosen = [every.index(name) for name in outputs or every]
    over = over_runs(kernel)

    def steps(**columns: Any) -> list[Any]:
        """The chosen outputs of all samples."""
        inputs = columns.pop(INPUTS)
        par = [value[0] if isinstance(value, tuple) else value for value in columns.values()]
        constants = over.constants(par)
        state, made = over.initial(inputs[:width], par)
        rows = [made]
        for k in range(width, len(inputs), width):
            state, made = over.advance(state, inputs[k : k + width], constants)
            rows.append(made)
        return [made[k] for made in rows for k in chosen]

    return plan(steps, **columns_of(kernel), **{INPUTS: samples * width})
