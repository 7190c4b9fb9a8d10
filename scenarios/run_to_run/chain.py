"""Kernels in each other's loop over many runs, cycle after cycle, by the loop that runs a scenario as vectors.

A part takes what those before it say at the end of the step, and what those behind it said at its beginning, as
components do under the master of a scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.native import own_compiler
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes.plan import columns_in_c
from gapsense.kernels.layout import names
from gapsense.vectors import library
from gapsense.vectors.library import Places, Room, aligned_zeros, fill_structure, of_kernel, places, structure, table

Floats = npt.NDArray[np.float64]


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

    def __init__(self, parts: Sequence[Part], recorded: Sequence[str], given: Sequence[str], fine: int = 1) -> None:
        self.parts, self.recorded, self.given, self.fine = parts, recorded, given, fine
        self.room = Room(1)  # the first place says whether a run has failed, which nobody asks
        outputs = (f"{part.name}.{name}" for part in parts for name in names(part.kernel.module.Outputs))
        self.at = {name: self.room.take(1) for name in (*given, *outputs)}
        self.places = [self._places(part) for part in parts]

    def _places(self, part: Part) -> Places:
        found = of_kernel(part.kernel) if own_compiler() else None
        if found is None:
            raise RuntimeError("This study needs a C compiler: `cc`, `gcc`, `clang`, or what `CC` names. Install one.")
        own = self.room.take(len(found.inputs))
        return places(found, self.room, own, own, self.at[f"{part.name}.{found.outputs[0]}"])

    def loop(self, dt: float) -> Any:
        """All for C, with this time from sample to sample [s]."""
        return fill_structure(
            library.Loop,
            parts=[self._structure(part, at, dt) for part, at in zip(self.parts, self.places)],
            base_step=dt / self.fine,
            decimation=self.fine,
            columns=[self.at[name] for name in self.recorded],
            places=[self.at[name] for name in self.given],
        )

    def _structure(self, part: Part, at: Places, dt: float) -> Any:
        every, duration = (1, dt / self.fine) if part.is_fine else (self.fine, dt)
        wires = {place: part.wires.get(name) for place, name in enumerate(at.functions.inputs, at.own)}
        links = [library.Link(place, self.at[wire]) for place, wire in wires.items() if isinstance(wire, str)]
        return structure(at, duration, links=links, follows=True, duration=duration, every=every)


class Block:
    """As many runs of a chain as a vector has numbers."""

    def __init__(self, made: Chain, first: int, count: int, par: Mapping[str, Any], given: Sequence[float]) -> None:
        width = library.loop().width()
        self.lanes = first + np.minimum(np.arange(width), count - 1)  # run of each; the last one where there is none
        self.values = aligned_zeros(made.room.size, width)
        self.arrays = [np.zeros((n, width)) for n in made.room.memories]
        self.values[[made.at[name] for name in made.given]] = np.reshape(given, (-1, 1))
        self.numbers: dict[str, int] = {}  # places of the parameters
        for part, at in zip(made.parts, made.places):
            for place, name in enumerate(at.functions.inputs, at.own):
                self.values[place] = wire if isinstance(wire := part.wires.get(name), float) else 0.0
            entries = [f"{part.name}.{name}" for name in names(part.kernel.module.Parameters)]
            self.numbers |= {name: place for k, (name, place) in enumerate(zip(entries, at.par)) if k not in at.tables}
            for k, place in at.tables.items():
                self.arrays[place] = table(par[entries[k]], width)
        self.runs = library.Runs(columns=columns_in_c(self.arrays), count=count, v=self.values.ctypes.data, next=1)

    def prepare(self, loop: Any, par: Mapping[str, Any]) -> None:
        """Set all parameters that are numbers, and compute what steps need of them."""
        for name, place in self.numbers.items():
            row = par[name][0]
            self.values[place] = row[self.lanes] if row.size > 1 else row
        for part in loop.parts[: loop.part_count]:
            library.loop().prepare(part, self.runs)


class Running:
    """Runs of a chain, from cycle to cycle."""

    def __init__(self, made: Chain, par: Mapping[str, Any], given: Sequence[float], dt: float, runs: int) -> None:
        """`par` are columns of flat parameters by `part.parameter`, `given` what is given at the first sample."""
        self.chain, self.runs, self.samples, self.c, self.loop = made, runs, 0, library.loop(), made.loop(dt)
        width = self.c.width()
        self.blocks = [
            Block(made=made, first=k, count=min(width, runs - k), par=par, given=given) for k in range(0, runs, width)
        ]
        for block in self.blocks:
            block.prepare(self.loop, par)
            for part in self.loop.parts[: self.loop.part_count]:
                self.c.begin(self.loop, block.runs, part, True)

    def go(self, par: Mapping[str, Any], given: Floats) -> Floats:
        """The next samples: what is recorded, (samples, outputs, runs), of what is given, (samples, names)."""
        made, begun, self.loop.rows = self.chain, self.samples + 1, len(given)
        played = np.repeat(np.asarray(given, float), made.fine, axis=0)
        data = np.empty((self.runs, len(made.recorded), len(given)))
        self.samples += len(given)
        for block in self.blocks:
            block.prepare(self.loop, par)
            block.runs.data = data[block.lanes[0] :].ctypes.data - begun * data.itemsize  # C counts rows from the start
            block.runs.played, block.runs.played_from = played.ctypes.data, block.runs.next
            self.c.advance(self.loop, block.runs, self.samples * made.fine)
        return np.ascontiguousarray(data.transpose(2, 1, 0))
