"""Kernels over runs: each run with inputs, parameters and a state of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from gapsense.kernels.emit import HARMLESS_IN_C, Lanes, split
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes.code import WHOLE, Call, Code, Record, Value
from gapsense.kernels.lanes.plan import KEEP, KEPT, NOWHERE, OWN, TAKE, Array, Floats, Plan, Program, Step, columns_with
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


def step_runs(kernel: Kernel, inputs: Any, par: Sequence[Any], outputs: Sequence[str] = ()) -> Floats:
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
    made = [Sample([[(INPUTS, k * width + j) for j in range(width)]]) for k in range(samples)]
    return plan_steps(kernel, {INPUTS: samples * width}, made, [every.index(name) for name in outputs or every])


class Sample(NamedTuple):
    """The steps up to a sample, each by what its inputs are: column and row, or a number at the first one."""

    steps: Sequence[Sequence[Any]]
    par: int = 0  # row of the first parameter, where that changes


def plan_steps(kernel: Kernel, given: Mapping[str, int], samples: Sequence[Sample], outputs: Sequence[int]) -> Plan:
    """The plan of a kernel from its first sample on; kept are these outputs of each sample, (samples, outputs).

    All steps are one call, whose results are in the places of its arguments. To record each, as `plan` does, takes ten
    times as long, which is longer than a fit of a record whose edges have been moved.
    """
    over, record, par_sizes = over_runs(kernel), Record(), columns_of(kernel)
    sizes = {**par_sizes, **given}
    par = [Value(record, name, WHOLE if isinstance(size, Array) else 0) for name, size in par_sizes.items()]
    first = [Value(record, *at) if isinstance(at, tuple) else record.value(at) for at in samples[0].steps[0]]
    inputs, (state, made) = [Value(record) for _ in first], over.initial(first, par)
    after, found = over.advance(state, inputs, over.constants(par))
    begin, *prepare, step = record.calls
    writer = _FixedPlaces(record, columns_with(record, sizes), dict(zip((*after, *found), (*state, *made))))
    writer.needed = {value for call in record.calls for value in call.taken} | {made[k] for k in outputs}

    def kept(sample: int) -> Iterator[Step]:
        for row, k in enumerate(outputs, sample * len(outputs)):
            yield KEEP, [writer.columns[KEPT], row, writer.place(made[k])]

    steps = [*writer.take_all(begin), writer.call(begin), *kept(0)]
    steps += [each for call in prepare for each in (*writer.take_all(call), writer.call(call))]
    steps += writer.take_all(step)
    again, constants = writer.call(step), [writer.call(call) for call in prepare]
    for k, sample in enumerate(samples[1:], 1):
        if sample.par:
            steps += [writer.take(par[0].column, sample.par, par[0]), *constants]
        for entries in sample.steps:
            steps += [writer.take(name, row, value) for (name, row), value in zip(entries, inputs)]
            steps.append(again)
        steps += kept(k)
    program = Program(steps, [*writer.columns], writer.codes, NOWHERE + 1 + len(writer.places))
    return Plan(record, sizes, [made[k] for k in outputs] * len(samples), program)


class _FixedPlaces:
    """Gives each value a place of its own, and those of the next step the places of this one."""

    def __init__(self, record: Record, columns: Sequence[str], same: Mapping[Value, Value]) -> None:
        self.columns = {name: k for k, name in enumerate(columns)}
        self.codes = list(dict.fromkeys(call.code for call in record.calls))
        self.same, self.needed, self.places = same, set[Value](), dict[Value, int]()

    def place(self, value: Value) -> int:
        value = self.same.get(value, value)
        if value.row == WHOLE:
            return self.columns[value.column]
        return self.places.setdefault(value, NOWHERE + 1 + len(self.places)) if value in self.needed else NOWHERE

    def take(self, column: str, row: int, value: Value) -> Step:
        return TAKE, [self.columns[column], row, self.place(value)]

    def take_all(self, call: Call) -> list[Step]:
        """What a call takes of columns."""
        return [self.take(v.column, v.row, v) for v in dict.fromkeys(call.taken) if v.column and v.row != WHOLE]

    def call(self, call: Call) -> Step:
        return OWN + self.codes.index(call.code), [*map(self.place, (*call.taken, *call.made))]
