"""Computations of a study in worker processes; what has been computed once is never computed again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gapsense._os.files import fingerprint
from gapsense._os.importable import facts, importable_name, imported
from gapsense._os.workers import Entry, Job, Local, Progress
from gapsense.many.execute import computed
from gapsense.many.provenance import key
from gapsense.many.store import RUNS, Store, alone

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

    The function stands at the top level of a module, which the workers import.  `setting`, which all tasks share, the
    tasks and the results are of JSON.  `file` takes each result as soon as it is there, and has it after a Ctrl-C,
    which is a KeyboardInterrupt; what is there for the same code, setting and task is not computed again.  `progress`
    is called after each task with tasks done and tasks in all.
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

        count, interrupted = computed(Local(job, len(missing)), missing, len(numbers), keep, progress)
        if interrupted:
            raise KeyboardInterrupt
        found = {n: json.loads(store.content(RUNS, n) or b"null") for n in numbers}
    return Answers([found[number(task)] for task in tasks], count)


def answers(request: Facts) -> Callable[[int], Facts]:
    """Function that a worker answers the number of a task with."""
    function, setting, tasks = imported(request["function"]), request["setting"], request["tasks"]
    return lambda n: {"result": function(setting, tasks[str(n)])}  # names in JSON are texts


def number(task: Facts) -> int:
    """Number of a task, by its content."""
    return int(fingerprint(task)[:12], 16)
