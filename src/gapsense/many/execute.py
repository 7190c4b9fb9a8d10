"""Do the runs that are missing, by vectors, by processes here or on a cluster, and keep each as it ends."""

from __future__ import annotations

import os
import pickle
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense._os.importable import importable_name
from gapsense._os.processes import Died, Marks
from gapsense._os.workers import Entry, Executor, Job, Local, Progress, work
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.result.result import Measure
from gapsense.cosim.run.ahead import FMU, VECTORS
from gapsense.cosim.run.apart import limit_of
from gapsense.cosim.run.engines import vectors_for
from gapsense.cosim.run.recording import death
from gapsense.cosim.run.subject import Subject
from gapsense.cosim.scenario.order import execution_order
from gapsense.cosim.scenario.records import Scenario
from gapsense.many.columns import ERROR, Columns, contents
from gapsense.many.plan import Plan
from gapsense.many.store import Store
from gapsense.many.worker import Runs


@dataclass(frozen=True)
class Many:
    """Runs of a scenario over a plan, and what is kept of each."""

    scenario: Scenario
    descriptions: Descriptions
    plan: Plan
    columns: Columns
    signals: tuple[str, ...] = ()  # patterns of the trajectories that are kept
    decimation: int = 1  # of their rows
    measure: Measure | None = None  # further metrics
    folder: Path | None = None  # for a CSV file of each run
    files: tuple[Path, ...] = ()  # that the plan's values name
    tries: int = 1  # of a run whose process dies

    def request(self, index: int) -> dict[str, Any]:
        """What a worker is asked for a run, of JSON."""
        values = {str(port): value for port, value in self.plan.values(index).items()}
        return {"index": index, "shift": self.plan.shift(index), "values": values}

    def job(self, workers: int = 1) -> Job:
        """What processes do, on whatever machine."""
        task = {
            "pickled": b64encode(pickle.dumps((self.scenario, self.descriptions))).decode(),
            "measure": self.measure and importable_name(self.measure),
            "keep": self.folder and str(self.folder.resolve()),
            "signals": list(self.signals),
            "decimation": self.decimation,
        }
        return Job(
            prepare=Runs,
            task=task,
            workers=workers,
            guest=self.measure,
            on_worker_death=death_entry(self.scenario, self.descriptions),
            limit=limit_of(self.scenario),
            request=self.request,
            tries=self.tries,
        )


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


def death_entry(scenario: Scenario, descriptions: Descriptions) -> Callable[[Died, Marks], Mapping[str, Any]]:
    """Function that makes an entry of a run that has ended its process, with the last that this wrote."""
    order = execution_order(list(scenario.components), scenario.connections, descriptions).names

    def entry(died: Died, marks: Marks) -> Mapping[str, Any]:
        last, error = died.words.rpartition("\n")[2], str(death(scenario, order, died, marks))
        return {ERROR: f"{error} It wrote: {last}" if last and "exit code" in died.cause else error}

    return entry


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
