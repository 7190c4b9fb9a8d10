"""Many runs of a scenario with values that a study draws: as vectors, or by FMUs where vectors cannot do them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.processes import new_marks
from gapsense.cosim.prepare import prepare
from gapsense.cosim.run.ahead import AUTO
from gapsense.cosim.run.engines import vectors_for
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.run import run_once
from gapsense.cosim.run.subject import Subject
from gapsense.cosim.run.worker import by_port
from gapsense.cosim.scenario.document import Source
from gapsense.tables import Value

Values = Mapping[str, Value]  # by `component.parameter`
Signals = npt.NDArray[np.float64]  # (rows, names)


def signals(
    scenario: Source,
    variant: str | None,
    names: Sequence[str],
    draws: Sequence[Values],
    seeds: Sequence[int] | None = None,
    engine: str = AUTO,
) -> Iterator[tuple[int, Signals]]:
    """Number of each run, in any order, and its signals.

    Parameters
    ----------
    scenario : str, Path or Document
        The scenario.
    variant : str or None
        Its variant.
    names : sequence of str
        Signals, as `valve.position`.
    draws : sequence of mappings
        Of each run: values of parameters by `component.parameter`.
    seeds : sequence of int, optional
        Of each run: what is added to the scenario's seeds; by default nothing.
    engine : str
        As of `gapsense.sweep`.
    """
    read, descriptions = prepare(scenario, variant)
    read = replace(read, record=replace(read.record, signals=tuple(names)), metrics=())
    subject = Subject(read, descriptions)
    order = [[*subject.about].index(name) for name in names]
    asked = [*zip(seeds or [0] * len(draws), map(by_port, draws))]
    vectors = vectors_for(subject, engine)
    if vectors is None:
        yield from by_fmus(subject, asked, order)
        return
    takes = [subject.taken(*one) for one in asked]
    for k, recording in vectors.record(takes):
        yield k, recording.data[:, order] if recording else next(by_fmus(subject, [asked[k]], order))[1]


def by_fmus(subject: Subject, asked: Sequence[tuple[int, Any]], order: Sequence[int]) -> Iterator[tuple[int, Signals]]:
    """The same by FMUs in this process; FmuError if a run fails."""
    master = Master(subject.scenario, subject.descriptions, new_marks())
    try:
        for k, (shift, point) in enumerate(asked):
            columns = [*run_once(master, shift, point=point).signals.values()]
            yield k, np.column_stack([columns[place] for place in order])
    finally:
        master.close()
