"""The model with several parameter sets at once, in C over runs; the numbers are those of `model.simulate`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.device import Device, kernel_of
from gapsense.identification.valve.model import Experiment, Response, jumps, simulated
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Array, Plan, over_runs, plan
from gapsense.kernels.lanes.kernels import columns_of
from gapsense.kernels.layout import flat

RESISTANCE = "coil_resistance"  # the first parameter; it differs from interval to interval, not from run to run


def currents(pars: Sequence[Device], experiment: Experiment) -> list[Vector]:
    """Current of each model."""
    return [response.current for response in responses(pars, experiment)]


def responses(pars: Sequence[Device], experiment: Experiment) -> list[Response]:
    """What is fitted of each model; one after the other in scalar Python, where numpy would be slower."""
    kernel, with_position = kernel_of(pars[0]), experiment.position is not None
    count, changes = experiment.current.size, np.diff(experiment.resistance, prepend=np.nan) != 0.0
    recorded = plan_of(kernel, tuple(jumps(experiment.halves).tolist()), tuple(changes.tolist()), with_position)
    if recorded.library is None:
        models = [simulated(par, experiment) for par in pars]
        return [Response(model.current, model.position if with_position else None) for model in models]
    halves, dt = experiment.halves, experiment.dt
    columns: dict[str, Any] = dict(zip(columns_of(kernel), zip(*map(flat, pars))))
    columns = {name: np.transpose(v) if isinstance(v[0], list) else [v] for name, v in columns.items()}
    columns[RESISTANCE] = experiment.resistance
    columns |= {"mean": halves.mean(axis=1), "first": halves[:, 0], "second": halves[:, 1]}
    columns |= {"at": [k * dt for k in range(count)], "steps": [dt, 0.5 * dt]}
    made = recorded.run(len(pars), **columns).T
    return [Response(run[:count], run[count:] if with_position else None) for run in made]


@cache
def plan_of(kernel: Kernel, jump: tuple[bool, ...], changes: tuple[bool, ...], with_position: bool) -> Plan:
    """The plan of an experiment in which voltage and resistance jump in these intervals."""
    count, names = len(jump), kernel.module.Outputs._fields
    wanted = [names.index(name) for name in ("current", "position")[: 2 if with_position else 1]]

    def found(at: Any, steps: Any, mean: Any, first: Any, second: Any, **par: Any) -> list[Any]:
        over, resistance = over_runs(kernel), par.pop(RESISTANCE)
        others = [value[0] if isinstance(value, tuple) else value for value in par.values()]
        state, outputs = over.initial((0.0, 0.0, 0.0), (resistance[0], *others))
        constants, kept = over.constants((resistance[0], *others)), [outputs]
        for k in range(1, len(jump)):
            constants = over.constants((resistance[k], *others)) if changes[k] else constants
            inputs = [(steps[1], first[k]), (steps[1], second[k])] if jump[k] else [(steps[0], mean[k])]
            for step, voltage in inputs:
                state, outputs = over.advance(state, (at[k], step, voltage), constants)
            kept.append(outputs)
        return [outputs[k] for k in wanted for outputs in kept]

    sizes: dict[str, int | Array] = {**columns_of(kernel), RESISTANCE: count, "at": count, "steps": 2}
    return plan(found, **sizes, **dict.fromkeys(("mean", "first", "second"), count))
