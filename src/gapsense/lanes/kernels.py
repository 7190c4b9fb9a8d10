"""Kernels over runs: each run with inputs, parameters and a state of its own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from gapsense.emit import HARMLESS_IN_C, Lanes, split
from gapsense.kernel import Kernel
from gapsense.lanes.code import Code, Row
from gapsense.lanes.plan import Array, Floats, Plan, plan
from gapsense.records import fields, names


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
    of_tables = tables(kernel)
    entries = dict(zip(names(kernel.module.Parameters), par))
    numbers = [np.atleast_1d(value) for name, value in entries.items() if name not in of_tables]
    samples, width, count = np.shape(inputs)
    runs = max(
        count,
        *(np.shape(entries[name])[-1] for name in of_tables if np.ndim(entries[name]) == 2),
        *map(len, numbers),
        1,
    )
    found = plan_of(kernel, samples, (*outputs,)).run(
        runs,
        par=np.array([np.broadcast_to(value, runs) for value in numbers]),
        inputs=np.reshape(inputs, (samples * width, count)),
        **{name: entries[name] for name in of_tables},
    )
    return found.reshape(samples, -1, runs)


def tables(kernel: Kernel) -> list[str]:
    """Names of the parameters that are tables."""
    return [name for name, field in fields(kernel.module.Parameters).items() if field.kind == "table"]


@cache
def plan_of(kernel: Kernel, samples: int, outputs: tuple[str, ...]) -> Plan:
    """The plan of some samples, for `stepped`."""
    layout = names(kernel.module.Parameters)
    width, every = len(names(kernel.module.Inputs)), names(kernel.module.Outputs)
    chosen = [every.index(name) for name in outputs or every]
    over = over_runs(kernel)

    def steps(par: Row, inputs: Row, **given: Any) -> list[Any]:
        rest = iter(par)
        row = [given[name] if name in given else next(rest) for name in layout]
        constants = over.constants(row)
        state, made = over.initial(inputs[:width], row)
        rows = [made]
        for k in range(width, len(inputs), width):
            state, made = over.advance(state, inputs[k : k + width], constants)
            rows.append(made)
        return [made[k] for made in rows for k in chosen]

    of_tables = tables(kernel)
    sizes = {"par": len(layout) - len(of_tables), "inputs": samples * width}
    return plan(steps, **sizes, **dict.fromkeys(of_tables, Array.TABLE))
