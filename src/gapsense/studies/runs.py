"""Many runs of a scenario with values that a study draws: as vectors, or by FMUs where there is no compiler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.workers import Progress
from gapsense.cosim.check import prepare
from gapsense.cosim.run.ahead import VECTORS
from gapsense.cosim.run.engines import vectors_for
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.recording import Subject, new_marks
from gapsense.cosim.run.run import run_once
from gapsense.cosim.scenario.read import Document, Source, read_document
from gapsense.many.worker import by_port
from gapsense.problems import FmuError, ScenarioError
from gapsense.tables import Value, merged

Values = Mapping[str, Value]  # by `component.parameter`
Signals = npt.NDArray[np.float64]  # (rows, names)


def after(progress: Progress, before: int, total: int, each: int = 1) -> Callable[[int], None]:
    """What a part tells of what it has done, with what was done before it counted; `each` counts as so many."""
    return lambda done: progress(before + each * done, total)


def overlaid(scenario: Path, tables: Mapping[str, Any]) -> Document:
    """A scenario with tables laid over those of its file, as a variant's are."""
    problems: list[str] = []
    document = read_document(scenario, problems)
    if document is None:
        raise ScenarioError(problems)
    return replace(document, data=merged(document.data, tables), is_file=False)


def signals(
    scenario: Source,
    variant: str | None,
    names: Sequence[str],
    draws: Sequence[Values],
    seeds: Sequence[int] | None = None,
    engine: str = VECTORS,
) -> Iterator[tuple[int, Signals | None]]:
    """Number of each run, in any order, and its signals; nothing of a run in which a component fails.

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
    subject = Subject(replace(read, record=replace(read.record, signals=tuple(names)), metrics=()), descriptions)
    order = [[*subject.about].index(name) for name in names]
    asked = [*zip(seeds or [0] * len(draws), map(by_port, draws))]
    vectors = vectors_for(subject, engine)
    if vectors:
        for k, recording in vectors.record([subject.taken(*one) for one in asked]):
            yield k, recording.data[:, order] if recording else None
    else:
        for k, run in enumerate(by_fmus(subject, asked)):
            yield k, run[:, order] if run is not None else None


def by_fmus(subject: Subject, asked: Sequence[tuple[int, Any]]) -> Iterator[Signals | None]:
    """All recorded signals of each run, by FMUs in this process."""
    for shift, point in asked:
        master = Master(subject.scenario, subject.descriptions, new_marks())
        try:
            yield np.column_stack([*run_once(master, shift, point=point).signals.values()])
        except FmuError:
            yield None
        finally:
            master.close()
