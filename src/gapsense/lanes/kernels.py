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
        Flat parameters: arrays (runs,) or numbers for all runs; tables are lists, the same for all runs.
    outputs : sequence of str
        Names of the flat outputs that are wanted, all of them by default.
    """
    numbers = [value for value in par if not isinstance(value, list)]
    tables = {name: value for name, value in zip(names(kernel.module.Parameters), par) if isinstance(value, list)}
    columns = np.stack(np.broadcast_arrays(*map(np.atleast_1d, numbers))) if numbers else np.empty((0, 1))
    samples, width, count = np.shape(inputs)
    runs = max(count, columns.shape[1])
    found = plan_of(kernel, samples, (*outputs,)).run(
        runs, par=columns, inputs=np.reshape(inputs, (samples * width, count)), **tables
    )
    return found.reshape(samples, -1, runs)


@cache
def plan_of(kernel: Kernel, samples: int, outputs: tuple[str, ...]) -> Plan:
    """The plan of some samples, for `stepped`."""
    layout = names(kernel.module.Parameters)
    tables = [name for name, field in fields(kernel.module.Parameters).items() if field.kind == "table"]
    width, every = len(names(kernel.module.Inputs)), names(kernel.module.Outputs)
    chosen = [every.index(name) for name in outputs or every]
    over = over_runs(kernel)

    def steps(par: Row, inputs: Row, **of_tables: Any) -> list[Any]:
        rest = iter(par)
        row = [of_tables[name] if name in of_tables else next(rest) for name in layout]
        constants = over.constants(row)
        state, made = over.initial(inputs[:width], row)
        rows = [made]
        for k in range(width, len(inputs), width):
            state, made = over.advance(state, inputs[k : k + width], constants)
            rows.append(made)
        return [made[k] for made in rows for k in chosen]

    sizes = {"par": len(layout) - len(tables), "inputs": samples * width}
    return plan(steps, **sizes, **dict.fromkeys(tables, Array.TABLE))
