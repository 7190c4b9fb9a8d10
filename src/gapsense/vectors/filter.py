"""One component alone over the samples of many records, in C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.vectors import library
from gapsense.vectors.library import Functions, Room, aligned, columns, entries_of, ints, places, structure, table

Floats = npt.NDArray[np.float64]
THREADS = 2  # more than memory can feed help little


def filtered(
    found: Functions,
    values: Mapping[str, Any],
    inputs: Sequence[Floats],
    chosen: Sequence[int],
    start: float,
    step: float,
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Chosen outputs (runs, outputs, samples) of a component, and which runs failed; each input is (runs, samples).

    `values` are those of the fields of its parameters; the first sample is at `start`, each after a `step` [s].
    """
    runs, samples = inputs[0].shape
    data, failed = np.empty((runs, len(chosen), samples)), np.zeros(runs, dtype=bool)
    room, c = Room(0), library.loop()
    lost, own, output = map(room.take, (1, len(inputs), len(found.component.of("output"))))
    at = places(found, room, own, own, output)
    part, loop = structure(at, step), library.Loop(start=start, base_step=step, failed=lost)
    signals = (library.Signal * len(inputs))(*(library.Signal(x.ctypes.data, *x.strides) for x in inputs))
    recorded, width = ints(output + k for k in chosen), c.width()

    def do(first: int) -> None:
        """The runs from one on that fit into a vector."""
        count = min(width, runs - first)
        v, arrays = aligned(room.size, width), [np.zeros((size, width)) for size in room.memories]
        for k, entry in enumerate(entries_of(found, values)):
            if k in at.tables:
                arrays[at.tables[k]] = table(entry, width)
            else:
                v[at.par[k]] = entry
        block = library.Runs(columns=columns(arrays), count=count, v=v.ctypes.data, data=data.ctypes.data)
        c.prepare(part, block)
        c.filter(loop, block, part, signals, first, recorded, len(chosen), samples)
        failed[first : first + count] = v[lost, :count] != 0.0

    with ThreadPoolExecutor(THREADS) as threads:
        [*threads.map(do, range(0, runs, width))]
    return data, failed
