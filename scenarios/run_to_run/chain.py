"""Kernels in each other's loop over many runs: a co-simulation of one cycle after the other, in their order, by lanes.

A part takes what those before it say at the end of the step, and what those behind it said at its beginning, as
components do under the master of a scenario.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Array, Plan, over_runs, plan
from gapsense.kernels.lanes.kernels import columns_of
from gapsense.kernels.layout import fields, names

Floats = npt.NDArray[np.float64]
CLOCK = "clock"  # column: time of every sample, and step
GIVEN = "given"  # column: what is given at every sample
SCALARS, SAID = "scalars", "said"  # columns: states and outputs at the last sample


class Part(NamedTuple):
    """A kernel, and where its inputs come from: `part.output`, a number, or the name of what is given."""

    name: str
    kernel: Kernel
    wires: Mapping[str, str | float]
    is_fine: bool = False  # steps several times from sample to sample


class Chain:
    """Parts in their order, the outputs that are recorded, and the names of what is given at every sample.

    Fine parts, which come first, take `fine` steps from sample to sample; what they hear from others is held.
    """

    def __init__(
        self, parts: Sequence[Part], recorded: Sequence[str], given: Sequence[str], samples: int, fine: int = 1
    ) -> None:
        self.parts, self.recorded, self.given, self.samples, self.fine = parts, recorded, given, samples, fine

    @cached_property
    def beginning(self) -> Plan:
        """The first sample: states and outputs of all parts."""
        columns = {**self._parameters(), CLOCK: 2, GIVEN: len(self.given)}
        return plan(lambda **given: self._begun(**given), **columns)

    @cached_property
    def cycle(self) -> Plan:
        """Some samples more."""
        scalars = sum(kind != "memory" for part in self.parts for kind in _kinds(part))
        columns = {**self._parameters(), CLOCK: 2 + self.samples * self.fine, GIVEN: self.samples * len(self.given)}
        left = {SCALARS: scalars, SAID: len(self._silent())}
        return plan(lambda **given: self._went(**given), **columns, **left, **self.memories)

    def _parameters(self) -> dict[str, int | Array]:
        return {f"{part.name}.{name}": size for part in self.parts for name, size in columns_of(part.kernel).items()}

    @cached_property
    def memories(self) -> dict[str, Array]:
        """Columns of array memory."""
        return dict.fromkeys(self.sizes(), Array.MEMORY)

    def sizes(self) -> dict[str, int]:
        """How many numbers the array memories have."""
        return {
            f"{part.name} {name}": field.size
            for part in self.parts
            for name, field in fields(part.kernel.module.State).items()
            if field.kind == "memory"
        }

    def _par(self, part: Part, columns: Mapping[str, Any]) -> list[Any]:
        values = [columns[f"{part.name}.{name}"] for name in columns_of(part.kernel)]
        return [value[0] if isinstance(value, tuple) else value for value in values]

    def _inputs(self, part: Part, time: Any, dt: Any, row: Sequence[Any], said: Mapping[str, Any]) -> list[Any]:
        known = {"time": time, "dt": dt, **dict(zip(self.given, row)), **said}
        wires = {"time": "time", "dt": "dt", **part.wires}
        entries = [wires.get(name, 0.0) for name in names(part.kernel.module.Inputs)]
        return [known[entry] if isinstance(entry, str) else entry for entry in entries]

    def _begun(self, **columns: Any) -> list[Any]:
        """Scalars of all states, then all outputs."""
        time, dt = columns[CLOCK]
        states, said = [], self._silent()
        for part in self.parts:
            inputs = self._inputs(part, time, dt, columns[GIVEN], said)
            state, outputs = over_runs(part.kernel).initial(inputs, self._par(part, columns))
            said |= self._said(part, outputs)
            states.append(state)
        return [*self._scalars(states), *said.values()]

    def _went(self, **columns: Any) -> list[Any]:
        """What is recorded of every sample, then scalars of all states, then all outputs."""
        dt, short, *times = columns[CLOCK]
        said = dict(zip(self._silent(), columns[SAID]))
        constants = [over_runs(part.kernel).constants(self._par(part, columns)) for part in self.parts]
        scalars, kept = iter(columns[SCALARS]), []
        states = [
            [
                columns[f"{part.name} {name}"] if kind == "memory" else next(scalars)
                for name, kind in zip(names(part.kernel.module.State), _kinds(part))
            ]
            for part in self.parts
        ]
        for instants, row in zip(_rows(times, self.fine), _rows(columns[GIVEN], len(self.given))):
            for k, part, time in self._steps(instants):
                inputs = self._inputs(part, time, short if part.is_fine else dt, row, said)
                states[k], outputs = over_runs(part.kernel).advance(states[k], inputs, constants[k])
                said |= self._said(part, outputs)
            kept += [said[name] for name in self.recorded]
        return [*kept, *self._scalars(states), *said.values()]

    def _scalars(self, states: Sequence[Sequence[Any]]) -> list[Any]:
        """What is no memory of all states."""
        entries = (zip(state, _kinds(part)) for part, state in zip(self.parts, states))
        return [value for value, kind in chain(*entries) if kind != "memory"]

    def _steps(self, instants: Sequence[Any]) -> Iterator[tuple[int, Part, Any]]:
        """Number and part of each step from one sample to the next, and the end of the step."""
        every = [*enumerate(self.parts)]
        yield from ((k, part, time) for time in instants for k, part in every if part.is_fine)
        yield from ((k, part, instants[-1]) for k, part in every if not part.is_fine)

    def _silent(self) -> dict[str, Any]:
        """All outputs, before anybody has said anything."""
        return {f"{part.name}.{name}": 0.0 for part in self.parts for name in names(part.kernel.module.Outputs)}

    @staticmethod
    def _said(part: Part, outputs: Sequence[Any]) -> dict[str, Any]:
        return {f"{part.name}.{name}": v for name, v in zip(names(part.kernel.module.Outputs), outputs)}


def _kinds(part: Part) -> list[str]:
    """Of every flat entry of the state, whether it is memory."""
    kinds = {name: field.kind for name, field in fields(part.kernel.module.State).items()}
    return [kinds.get(name, "scalar") for name in names(part.kernel.module.State)]


def _rows(values: Sequence[Any], width: int) -> list[Sequence[Any]]:
    return [values[k : k + width] for k in range(0, len(values), width)]


class Running:
    """Runs of a chain, from cycle to cycle."""

    def __init__(self, made: Chain, par: Mapping[str, Any], given: Sequence[float], dt: float, runs: int) -> None:
        """`par` are columns of flat parameters by `part.parameter`, `given` what is given at the first sample."""
        self.chain, self.dt, self.runs, self.samples = made, dt, runs, 0
        first = made.beginning.run(runs, **par, **{CLOCK: np.array([0.0, 0.0]), GIVEN: np.array(given)})
        count = made.cycle.given[SCALARS]
        self.scalars, self.said = first[:count], first[count:]
        self.memories = {name: np.zeros((size, runs)) for name, size in made.sizes().items()}

    def go(self, par: Mapping[str, Any], given: Floats) -> Floats:
        """The next samples: what is recorded, (samples, outputs, runs); `given` (samples, names) or (.., .., runs)."""
        made, n, fine = self.chain, self.chain.samples, self.chain.fine
        times = [(self.samples + k) * self.dt + j * self.dt / fine for k in range(n) for j in range(1, fine + 1)]
        rows = np.reshape(given, (n * len(made.given), *np.shape(given)[2:]))
        clock = np.array([self.dt, self.dt / fine, *times])
        left = {SCALARS: self.scalars, SAID: self.said}
        found = made.cycle.run(self.runs, **par, **{CLOCK: clock, GIVEN: rows}, **left, **self.memories)
        kept, count = n * len(made.recorded), len(self.scalars)
        self.scalars, self.said = found[kept : kept + count].copy(), found[kept + count :].copy()
        self.samples += n
        return found[:kept].reshape(n, len(made.recorded), self.runs)
