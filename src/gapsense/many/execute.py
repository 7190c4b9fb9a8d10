"""Do the runs that are missing, by vectors, by processes here or on a cluster, and keep each as it ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Entry, Executor, Local, Progress, work
from gapsense.cosim.run.ahead import FMU, VECTORS
from gapsense.cosim.run.engines import vectors_for
from gapsense.cosim.run.recording import Subject
from gapsense.many.columns import contents
from gapsense.many.store import Store
from gapsense.many.worker import Many


class Done(NamedTuple):
    """What became of it: runs done now, whether Ctrl-C ended it, and what did the runs."""

    computed: int
    interrupted: bool
    engine: str


def complete(
    many: Many,
    store: Store,
    workers: int,
    engine: str,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Done:
    """Do the runs of a plan that are not in a store yet."""
    total = len(many.plan)
    missing = np.setdiff1d(np.arange(total), store.runs(below=total), assume_unique=True)
    executor, by = executor_of(many, len(missing), workers, engine, scheduler)

    def keep(came: Sequence[Entry]) -> None:
        store.add(*contents(many.columns, [{**many.request(entry["index"]), **entry} for entry in came]))

    return Done(*computed(executor, missing.tolist(), total, keep, progress), by)


def computed(
    executor: Executor,
    missing: Sequence[int],
    total: int,
    keep: Callable[[Sequence[Entry]], None],
    progress: Progress | None,
) -> tuple[int, bool]:
    """Let an executor do the missing ones of `total` runs; how many were done, and whether Ctrl-C ended it."""
    tell, before, count = progress or (lambda done, total: None), total - len(missing), 0

    def take(came: Sequence[Entry]) -> None:
        nonlocal count
        keep(came)
        for _ in came:
            count += 1
            tell(before + count, total)

    tell(before, total)
    interrupted = work(executor, missing, len(missing), take)
    return count, interrupted


def executor_of(many: Many, missing: int, workers: int, engine: str, scheduler: str | None) -> tuple[Executor, str]:
    """Who does the runs, and whether as vectors or by FMUs."""
    if scheduler is not None:
        from gapsense.many.cluster import Cluster  # here, since it takes a while to load

        return Cluster(scheduler, many, missing), FMU
    job = many.job(workers)
    vectors = vectors_for(Subject(many.scenario, many.descriptions), engine) if missing else None
    if vectors is None:
        return Local(job, missing), FMU
    from gapsense.many.vectors import VectorExecutor

    return VectorExecutor(job, vectors), VECTORS


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
