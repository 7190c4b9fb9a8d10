"""One component alone over the samples of many records, in C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.lanes.plan import Column
from gapsense.vectors import library
from gapsense.vectors.library import Functions, ints
from gapsense.vectors.places import Room, aligned, entries_of, places, ranges

Floats = npt.NDArray[np.float64]
THREADS = 2  # more than memory can feed help little


class Filter:
    """A component with values for the fields of its parameters; `period` is that of its samples [s], 0 for none."""

    def __init__(self, found: Functions, values: Mapping[str, Any], period: float) -> None:
        component, self.room = found.component, Room(0)
        inputs, self.outputs = len(component.of("input")), len(component.of("output"))
        self.failed, own = self.room.take(1), self.room.take(inputs)
        self.first_output = self.room.take(self.outputs)
        self.places = places(found, self.room, own, self.first_output)
        self.entries, self.period = entries_of(found, values), period
        initial, constants, advance = self.places.calls
        self.spans = ranges(component, own)
        self.structure = library.Part(
            constants=constants,
            initial=initial,
            advance=advance,
            ranges=self.spans,
            range_count=len(self.spans),
            survives=component.survives,
            buffered=own,
            own=own,
            input_count=inputs,
            output=self.first_output,
            output_count=self.outputs,
            time=self.places.time,
            dt=self.places.time + 1,
        )

    def run(self, inputs: Sequence[Floats], chosen: Sequence[int], start: float, step: float) -> tuple[Floats, Floats]:
        """Chosen outputs (runs, outputs, samples), and which runs failed; each input is (runs, samples)."""
        runs, samples = inputs[0].shape
        data, failed = np.empty((runs, len(chosen), samples)), np.zeros(runs, dtype=bool)
        signals = (library.Signal * len(inputs))(*(library.Signal(x.ctypes.data, *x.strides) for x in inputs))
        loop = library.Loop(start=start, base_step=step, failed=self.failed)
        self.structure.duration, self.structure.period = step, self.period or step
        at = ints(self.first_output + k for k in chosen)
        width = library.loop().width()

        def block(first: int) -> None:
            count = min(width, runs - first)
            values = aligned(self.room.size, width)
            arrays = [np.zeros((size, width)) for size in self.room.memories]
            for k, entry in enumerate(self.entries):
                if k in self.places.tables:
                    arrays[self.places.tables[k]] = np.repeat(np.array(entry, float)[:, None], width, axis=1)
                else:
                    values[self.places.par[k]] = entry
            columns = (Column * len(arrays))(*(Column(a.ctypes.data, *a.strides, len(a)) for a in arrays))
            own = library.Runs(columns=columns, first=0, count=count, v=values.ctypes.data, data=data.ctypes.data)
            library.loop().prepare(self.structure, own)
            library.loop().filter(loop, own, self.structure, signals, first, at, len(chosen), samples)
            failed[first : first + count] = values[self.failed, :count] != 0.0

        with ThreadPoolExecutor(THREADS) as threads:
            [*threads.map(block, range(0, runs, width))]
        return data, failed
