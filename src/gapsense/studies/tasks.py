"""Computations of a study in worker processes; what has been computed once is never computed again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense.cosim.sweep import Job, Progress, importable_name
from gapsense.ledger import Entry, Ledger

Facts = Mapping[str, Any]  # of JSON
SRC = Path(__file__).resolve().parents[1]
CODE = ("*.py", "emit/*.py", "estimators/*.py", "studies/**/*.py")  # what the numbers depend on


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
    """Results of `function(setting, task)` for all tasks.

    Parameters
    ----------
    function : callable
        At the top level of a module, which the workers import; it returns what JSON can hold.
    setting : mapping
        The same for all tasks, of JSON.
    tasks : sequence of mappings
        What differs, of JSON.
    workers : int
        Processes; the numbers do not depend on it.
    file : Path, optional
        Takes a line per task as soon as it is done.  What is there for the same code, setting and task is not computed
        again.
    progress : callable, optional
        Called after each task with tasks done and tasks in all.

    Returns
    -------
    Answers

    Raises
    ------
    KeyboardInterrupt
        After a Ctrl-C; the file has what was computed.
    """
    if workers < 1:
        raise ValueError(f"{workers} workers found, at least 1 expected. Correct `--workers`.")
    numbers = {number(task): task for task in tasks}
    ledger = Ledger(file, key(function, setting))
    known = {n: entry for n, entry in ledger.read().items() if n in numbers}
    name, named = importable_name(function), {str(n): task for n, task in numbers.items()}
    request = {"function": name, "setting": setting, "tasks": named}
    job = Job(request, function, [n for n in numbers if n not in known], workers, "gapsense.studies.worker")
    if job.run(known, ledger, len(numbers), progress):
        raise KeyboardInterrupt
    return Answers([known[number(task)]["result"] for task in tasks], job.computed)


def answer(function: Callable[[Any, Any], Any], request: Facts, n: int) -> Entry:
    """Entry of one task, as a worker gives it."""
    return {"index": n, "result": function(request["setting"], request["tasks"][str(n)])}


def number(task: Facts) -> int:
    """Number of a task, by its content."""
    return int(_hash(task)[:12], 16)


def key(function: Callable[[Any, Any], Any], setting: Facts) -> str:
    """Hash of all that decides a result besides its task: setting, code, numpy."""
    files = sorted(path for pattern in CODE for path in SRC.glob(pattern))
    code = {path.relative_to(SRC).as_posix(): path.read_text(encoding="utf-8") for path in files}
    return _hash([importable_name(function), setting, code, np.__version__])


def _hash(facts: Any) -> str:
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
