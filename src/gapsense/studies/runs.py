"""What a study computes many times: runs of a scenario with values that it draws, or any function, in workers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.files import fingerprint
from gapsense._os.importable import facts, import_function, importable_name
from gapsense._os.workers import Entry, Job, Local, Progress
from gapsense.cosim.check import prepare
from gapsense.cosim.run.ahead import VECTORS
from gapsense.cosim.run.engines import vectors_for
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.recording import Subject, new_marks
from gapsense.cosim.run.run import run_once
from gapsense.cosim.scenario.read import Document, Source, document_of
from gapsense.many.execute import compute_missing
from gapsense.many.provenance import key
from gapsense.many.store import RUNS, Store, alone
from gapsense.many.worker import by_port
from gapsense.problems import FmuError
from gapsense.tables import Value, merge_tables

Values = Mapping[str, Value]  # by `component.parameter`
Signals = npt.NDArray[np.float64]  # (rows, names)


def after(progress: Progress, before: int, total: int, each: int = 1) -> Callable[[int], None]:
    """A progress function for a part of the work: `before` was done already, and each unit counts as `each`."""
    return lambda done: progress(before + each * done, total)


def overlaid(scenario: Path, tables: Mapping[str, Any]) -> Document:
    """A scenario with tables laid over those of its file, as those of a variant are."""
    document = document_of(scenario)
    return replace(document, data=merge_tables(document.data, tables), is_file=False)


def signals(
    scenario: Source,
    variant: str | None,
    names: Sequence[str],
    draws: Sequence[Values],
    seeds: Sequence[int] | None = None,
    engine: str = VECTORS,
) -> Iterator[tuple[int, Signals | None]]:
    """Number of each run, in any order, and its signals; None for a run in which a component fails.

    The `draws` are, for each run, values of parameters by `component.parameter`; `seeds` what it adds to the scenario's
    seeds, by default nothing. The `engine` is as of `gapsense.sweep`.
    """
    read, descriptions = prepare(scenario, variant)
    subject = Subject(replace(read, record=replace(read.record, signals=tuple(names)), metrics=()), descriptions)
    order = [[*subject.about].index(name) for name in names]
    asked = [*zip(seeds or [0] * len(draws), map(by_port, draws))]
    vectors = vectors_for(subject, engine)
    if vectors:
        for k, recording in vectors.record([subject.make_take(*one) for one in asked]):
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


# Computations in worker processes; what has been computed once is never computed again.


Facts = Mapping[str, Any]  # of JSON


class Answers(NamedTuple):
    """Results of tasks in their order, and how many of them were computed now."""

    results: list[Any]
    computed: int


def compute(
    function: Callable[[Any, Any], Any],
    setting: Facts,
    tasks: Sequence[Facts],
    workers: int,
    file: Path | None = None,
    progress: Progress | None = None,
) -> Answers:
    """Results of `function(setting, task)` for all tasks; the number of `workers` does not change them.

    The function stands at the top level of a module, which the workers import. Tasks, results and `setting`, which all
    tasks share, must be valid JSON. `file` keeps each result as soon as it is there, also after a Ctrl-C, which raises
    a KeyboardInterrupt. What is there for the same code, setting and task is not computed again. `progress` is called
    after each task with the tasks done and the tasks in all.
    """
    if workers < 1:
        raise ValueError(f"{workers} workers found, at least 1 expected. Correct `--workers`.")
    numbers = {number(task): task for task in tasks}
    request = {"function": importable_name(function), "setting": setting, "tasks": numbers}
    job = Job(answers, request, workers, function)
    with alone(file), Store(file, key([facts(function), setting])) as store:
        store.describe({"function": request["function"]})
        missing = [n for n in numbers if store.content(RUNS, n) is None]

        def keep(came: Sequence[Entry]) -> None:
            store.add({entry["index"]: json.dumps(entry["result"]).encode() for entry in came})

        count, interrupted = compute_missing(Local(job, len(missing)), missing, len(numbers), keep, progress)
        if interrupted:
            raise KeyboardInterrupt
        found = {n: json.loads(store.content(RUNS, n) or b"null") for n in numbers}
    return Answers([found[number(task)] for task in tasks], count)


def answers(request: Facts) -> Callable[[int], Facts]:
    """Function with which a worker answers the number of a task."""
    function, setting, tasks = import_function(request["function"]), request["setting"], request["tasks"]
    return lambda n: {"result": function(setting, tasks[str(n)])}  # names in JSON are texts


def number(task: Facts) -> int:
    """Number of a task, by its content."""
    return int(fingerprint(task)[:12], 16)
